"""On PostgreSQL, too, all acknowledged runs are there, whether one of several services or the server is killed."""

import random
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from typing import Any

import httpx2
import numpy as np
import pytest

from storage import jobs
from storage.engine.database import Database
from storage.engine.opening import find_database
from tests.journeys.faults.test_kills import Acknowledged, kills, post_until_killed, require_all
from tests.service.workflows import stand_in_engine
from tests.storage.engine.postgresql.server import PostgresServer, postgresql_server
from tests.support import ONCE, serving, stationary

#: [s] Within which a server that was killed is used again.
IN_TIME = 60.0
#: The clutch that is diagnosed, by an engine that takes two seconds; a killed service's job is begun again soon.
DIAGNOSED = "diagnosed"
SEVERAL = {"CLUTCHLIFE_ENGINE": f"{stand_in_engine.__name__}:slow", "CLUTCHLIFE_JOB_LEASE_SECONDS": "2"}


@pytest.fixture
def postgres() -> Iterator[PostgresServer]:
    """A server of the test's own, which it may kill."""
    with postgresql_server() as server:
        yield server


@pytest.mark.slow
@kills(3, 50)
def test_no_acknowledged_run_is_lost_where_postgresql_is_killed(postgres: PostgresServer, number: int) -> None:
    """The service lives on: it refuses what it cannot store, and goes on when the server is back."""
    url, rng = postgres.fresh(), random.Random(number)  # noqa: S311 - moments, not secrets
    acknowledged: Acknowledged = {}
    refused: list[int] = []
    done = threading.Event()
    with serving(url, loaded=True) as server:
        poster = threading.Thread(target=post_until_done, args=(server.url, acknowledged, refused, done))
        poster.start()
        try:
            for _ in range(number):
                wait_for_runs(acknowledged, 2)
                time.sleep(rng.uniform(0.0, 0.08))
                postgres.kill()
                time.sleep(0.1)
                postgres.start()
            wait_for_runs(acknowledged, 2)
        finally:
            done.set()
            poster.join()
        with httpx2.Client(base_url=server.url, timeout=60) as http:
            items = http.get("/v1/clutches/c1/runs", params={"limit": 1000}).json()["items"]
    assert set(refused) <= {503}
    assert {("c1", item["run_id"]) for item in items} >= acknowledged.keys()
    require_all(url, acknowledged, on_their_way=0)


@pytest.mark.slow
@kills(1, 20)
def test_what_a_killed_service_of_several_was_diagnosing_another_makes(postgres: PostgresServer, number: int) -> None:
    """Runs are posted at all services; the one that has a diagnosis is killed, and comes back later."""
    url, rng = postgres.fresh(), random.Random(number)  # noqa: S311 - moments, not secrets
    acknowledged: Acknowledged = {}
    with ExitStack() as stack:
        servers = [
            stack.enter_context(serving(url, loaded=True, environment=SEVERAL)) for _ in range(2 if number == 1 else 3)
        ]
        database = stack.enter_context(closing(find_database(url)))
        ONCE.post(f"{servers[0].url}/v1/clutches", json={"clutch_id": DIAGNOSED}).raise_for_status()
        for kill in range(number):
            post(servers[kill % len(servers)].url, DIAGNOSED, kill, acknowledged)
            posters = [
                threading.Thread(target=post_until_killed, args=(server.url, f"c{kill}-{place}", acknowledged))
                for place, server in enumerate(servers)
            ]
            for poster in posters:
                poster.start()
            address = f"{servers[kill % len(servers)].url}/v1/clutches/{DIAGNOSED}/diagnoses"
            asked = ONCE.post(address, json={}, headers={"Prefer": "wait=0"}).json()["diagnosis_id"]
            killed = next(each for each in servers if each.pid == claimer(database, asked))
            time.sleep(rng.uniform(0.0, 0.3))
            killed.kill()
            other = next(each for each in servers if each is not killed)
            assert finished(other.url, asked)["attempts"] == 2
            for poster in posters:
                poster.join()
            killed.start()
        found = ONCE.get(f"{servers[0].url}/v1/clutches/{DIAGNOSED}/diagnoses").json()["items"]
    assert [item["status"] for item in found] == ["finished"] * number
    assert len(acknowledged) > 40 * (len(servers) - 1) * number, "the others went on"
    require_all(url, acknowledged, on_their_way=number)


def claimer(database: Database, job_id: str) -> int:
    """The number of the process that has the job, once one has."""
    deadline = time.monotonic() + IN_TIME
    while True:
        with database.reading() as connection:
            job = jobs.get(connection, job_id)
        if job is not None and job.claimed_by is not None:
            return int(job.claimed_by.split(":")[1])
        assert time.monotonic() < deadline, "nobody claims it"
        time.sleep(0.01)


def finished(url: str, job_id: str) -> dict[str, Any]:
    """The job once it has ended."""
    deadline = time.monotonic() + 2 * IN_TIME
    while True:
        job: dict[str, Any] = ONCE.get(f"{url}/v1/jobs/{job_id}").json()
        if job["state"] not in ("waiting", "running"):
            assert job["state"] == "finished", job
            return job
        assert time.monotonic() < deadline, job
        time.sleep(0.1)


def post(url: str, clutch: str, number: int, acknowledged: Acknowledged) -> None:
    """Post a run, once."""
    sent = stationary(100 * number, run_id=f"r{number}", pressures=(4.0, 6.0))
    ONCE.post(f"{url}/v1/clutches/{clutch}/runs", json=sent).raise_for_status()
    acknowledged[clutch, f"r{number}"] = bits(sent)


def bits(sent: dict[str, Any]) -> dict[str, bytes]:
    """The channels of a body, bit for bit."""
    return {name: np.array(column).tobytes() for name, column in sent["channels"].items()}


def wait_for_runs(acknowledged: Acknowledged, number: int) -> None:
    """Wait until so many more runs are acknowledged."""
    enough, deadline = len(acknowledged) + number, time.monotonic() + IN_TIME
    while len(acknowledged) < enough:
        assert time.monotonic() < deadline, "no run was acknowledged"
        time.sleep(0.001)


def post_until_done(url: str, acknowledged: Acknowledged, refused: list[int], done: threading.Event) -> None:
    """Post runs of one clutch, each until it is acknowledged."""
    with httpx2.Client(base_url=url, timeout=60) as http:
        http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
        for number in range(100_000):
            sent = stationary(100 * number, run_id=f"r{number}", pressures=(4.0, 6.0))
            status = 0
            while status not in (200, 201):
                with suppress(httpx2.TransportError):
                    status = http.post("/v1/clutches/c1/runs", json=sent).status_code
                if status not in (200, 201):
                    refused.append(status)
                    time.sleep(0.02)
            acknowledged["c1", f"r{number}"] = bits(sent)
            if done.is_set():
                return
