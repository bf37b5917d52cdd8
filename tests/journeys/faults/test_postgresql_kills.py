"""On PostgreSQL, too, every run that was acknowledged is there, whether the service is killed or the server."""

import random
import threading
import time
from collections.abc import Iterator
from contextlib import suppress

import httpx2
import numpy as np
import pytest

from tests.journeys.faults.test_kills import findings, kills, post_until_killed, stored
from tests.storage.engine.postgresql.server import PostgresServer, postgresql_server
from tests.support import Server, serving, stationary

Acknowledged = dict[tuple[str, str], dict[str, bytes]]
#: [s] Within which a server that was killed is used again.
IN_TIME = 60.0


@pytest.fixture
def postgres() -> Iterator[PostgresServer]:
    """A server of the test's own, which it may kill."""
    with postgresql_server() as server:
        yield server


def require_all(url: str, acknowledged: Acknowledged, on_their_way: int) -> None:
    """Every acknowledged run is there bit for bit, with results that follow, and at most those beside it that were sent."""
    content = stored(url)
    assert {run: content.get(run) for run in acknowledged} == acknowledged
    assert len(content) <= len(acknowledged) + on_their_way
    assert findings(url) == []


@kills(3, 50)
def test_no_acknowledged_run_is_lost_where_the_service_is_killed(postgres: PostgresServer, number: int) -> None:
    url, rng = postgres.fresh(), random.Random(number)  # noqa: S311 - moments, not secrets
    acknowledged: Acknowledged = {}
    server = Server(url, loaded=True)
    for kill in range(number):
        server.start()
        poster = threading.Thread(target=post_until_killed, args=(server.url, f"c{kill}", acknowledged))
        before = len(acknowledged)
        poster.start()
        while len(acknowledged) < before + 2 and poster.is_alive():
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, 0.08))
        server.kill()
        poster.join()
    assert len(acknowledged) >= 2 * number
    require_all(url, acknowledged, on_their_way=number)


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
            items = http.get("/v1/clutches/c1/runs").json()["items"]
    assert set(refused) <= {503}
    assert {("c1", item["run_id"]) for item in items} >= acknowledged.keys()
    require_all(url, acknowledged, on_their_way=0)


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
            acknowledged["c1", f"r{number}"] = {
                name: np.array(column).tobytes() for name, column in sent["channels"].items()
            }
            if done.is_set():
                return
