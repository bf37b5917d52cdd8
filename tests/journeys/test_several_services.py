"""Several services on one PostgreSQL database answer as one: what one has taken in the others show at once."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from itertools import cycle
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.lab.benchmarks.memory import family, resident
from tests.service.changes import stand_in_engine
from tests.service.jobs.waiting import until
from tests.storage.engine.postgresql.server import PostgresServer
from tests.support import ONCE, Server, clutchlife, free_port, serving, stationary, wait_until_ready

ENVIRONMENT = {"CLUTCHLIFE_ENGINE": f"{stand_in_engine.__name__}:diagnose"}
CLUTCH = "/v1/clutches/c1"
READ = (
    "/v1/clutches", CLUTCH, *(f"{CLUTCH}/{name}" for name in (
        "runs", "remaining-useful-life", "series", "changes", "diagnoses", "model",
    )), "/v1/jobs", "/v1/fleet/priors",
)  # fmt: skip
#: What takes a second.
LONG = tuple(f"{CLUTCH}/{name}" for name in ("remaining-useful-life?method=grid", "degradation", "stribeck", "scores"))


@pytest.fixture
def address(postgresql: PostgresServer) -> Iterator[str]:
    url = postgresql.fresh()
    yield url
    postgresql.drop(url)


@pytest.fixture
def servers(address: str) -> Iterator[list[Server]]:
    with ExitStack() as stack:
        yield [stack.enter_context(serving(address, loaded=True, environment=ENVIRONMENT)) for _ in range(2)]


def seen(server: Server, paths: Sequence[str] = READ) -> dict[str, Any]:
    """Every answer, with its entity tag and revision."""
    answers = {}
    for path in paths:
        answer = server.http.get(path)
        assert answer.status_code == 200, answer.text
        answers[path] = (answer.headers["etag"], answer.headers.get("clutchlife-revision"), answer.json())
    return answers


def test_what_one_has_taken_in_each_other_shows_at_once(servers: list[Server]) -> None:
    """Every change goes to the next of the two, and the answers of both are alike right behind it."""
    with ExitStack() as stack:
        clients = [stack.enter_context(httpx2.Client(base_url=each.url, timeout=120)) for each in servers]
        turns = cycle(clients)
        changes: list[tuple[str, str, Any]] = [("POST", "/v1/clutches", {"clutch_id": "c1"})]
        changes += [
            ("POST", f"{CLUTCH}/runs", stationary(cycles, run_id=f"r{cycles}", pressures=(4.0, 6.0)))
            for cycles in (0, 1000, 2000, 1500)
        ]
        changes += [
            ("POST", f"{CLUTCH}/runs/r1500/withdraw", {"reason": "twice"}),
            ("PATCH", CLUTCH, {"reason": "typed", "fluid": "other"}),
        ]
        for method, path, body in changes:
            http = next(turns)
            http.request(method, path, json=body).raise_for_status()
            answers = [seen(server) for server in servers]
            assert answers[0] == answers[1]
        assert len(answers[0][f"{CLUTCH}/runs"][2]["items"]) == 4
        wait = {"Prefer": "wait=120"}
        diagnosed = clients[0].post(f"{CLUTCH}/diagnoses", json={"adopt": False}, headers=wait).json()
        assert (diagnosed["status"], diagnosed["verdict"]) == ("finished", "cause_named")
        answers = [seen(server, READ + LONG) for server in servers]
        assert answers[0] == answers[1]
        assert [job["state"] for job in answers[1]["/v1/jobs"][2]["items"]] == ["finished"]


def test_the_same_run_sent_to_all_at_once_is_one_run(servers: list[Server]) -> None:
    ONCE.post(f"{servers[0].url}/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
    sent = stationary(0, run_id="r0")
    with ThreadPoolExecutor(6) as pool:
        asked = [pool.submit(ONCE.post, f"{server.url}{CLUTCH}/runs", json=sent) for server in servers * 3]
        statuses = sorted(each.result().status_code for each in asked)
    assert statuses == [200] * 5 + [201]
    assert [len(server.http.get(f"{CLUTCH}/runs").json()["items"]) for server in servers] == [1] * 2


@pytest.mark.slow
def test_a_job_that_one_has_another_cancels(address: str, tmp_path: Path) -> None:
    environment = {
        "CLUTCHLIFE_ENGINE": f"{stand_in_engine.__name__}:endless",
        "CLUTCHLIFE_JOB_LEASE_SECONDS": "2",
        "STAND_IN_PID": str(tmp_path / "pid"),
    }
    with ExitStack() as stack:
        one, other = (stack.enter_context(serving(address, loaded=True, environment=environment)) for _ in range(2))
        one.http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
        asked = one.http.post(f"{CLUTCH}/diagnoses", json={}, headers={"Prefer": "wait=0"}).json()["diagnosis_id"]
        until((tmp_path / "pid").exists)
        process = Path("/proc", (tmp_path / "pid").read_text())
        for server in (one, other):
            assert server.http.delete(f"/v1/jobs/{asked}").json()["state"] == "cancelled"
        until(lambda: not process.exists())
        assert other.http.get(f"{CLUTCH}/diagnoses/{asked}").json()["problem"] == "cancelled by local"


def test_a_key_that_is_made_or_revoked_counts_everywhere(servers: list[Server], address: str) -> None:
    """A key that a command makes beside the services."""
    key = clutchlife("key", "create", "--scope", "read", "--database", address).strip()
    headers = {"Authorization": f"Bearer {key}"}
    assert clutchlife("key", "list", "--database", address).startswith(key.split("_")[1])

    def statuses() -> list[list[int]]:
        return [
            [server.http.get("/v1/clutches", headers=each).status_code for each in ({}, headers)] for server in servers
        ]

    assert statuses() == [[401, 200]] * 2
    assert ONCE.get(f"{servers[0].url}/v1/clutches/%00", headers=headers).status_code == 422
    assert ONCE.get(f"{servers[0].url}/readyz").json()["journal_mode"] is None
    clutchlife("key", "revoke", key.split("_")[1], "--database", address)
    assert statuses() == [[401, 401]] * 2


def test_processes_behind_one_port_need_a_server(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path}/a.db"
    said = clutchlife("serve", "--processes", "2", "--port", "0", "--database", database, code=64)
    assert "--processes 2 needs a database on a PostgreSQL server" in said


@pytest.mark.slow  # each process loads all libraries by itself
def test_processes_behind_one_port_answer_are_replaced_and_stop(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CLUTCHLIFE_WORKERS", "0")
    port = free_port()
    command = [sys.executable, "-m", "service.cli.main", "serve", "--processes", "2", "--port", str(port)]
    service = subprocess.Popen([*command, "--database", address, "--log-level", "warning"])
    url = f"http://127.0.0.1:{port}"
    try:
        wait_until_ready(url, lambda: service.poll() is not None)
        ONCE.post(f"{url}/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
        for cycles in range(0, 5000, 500):
            ONCE.post(f"{url}{CLUTCH}/runs", json=stationary(cycles)).raise_for_status()
            assert len(ONCE.get(f"{url}{CLUTCH}/runs").json()["items"]) == cycles // 500 + 1
        for _ in range(5):  # whichever is asked, all that was answered by either is counted
            text = ONCE.get(f"{url}/metrics").text
            posted = 'clutchlife_requests_total{method="POST",route="/v1/clutches/{clutch_id}/runs",status="201"} 10.0'
            assert posted in text
            assert 'clutchlife_worker_calls{lane="runs"} 0.0' in text
            both = sum(resident(pid) for pid in answering(service.pid))
            together = float(text.partition("\nprocess_resident_memory_bytes ")[2].partition("\n")[0])
            assert 0.8 * both < together < 1.2 * both
        killed = answering(service.pid).pop()
        os.kill(killed, signal.SIGKILL)
        answering(service.pid, killed)
        wait_until_ready(url, lambda: service.poll() is not None)
        assert len(ONCE.get(f"{url}{CLUTCH}/runs").json()["items"]) == 10
        assert posted in ONCE.get(f"{url}/metrics").text, "what the killed one has answered stays counted"
        service.send_signal(signal.SIGTERM)
        assert service.wait(60) == 0
    finally:
        service.kill()


def answering(parent: int, but: int = 0) -> set[int]:
    """The two processes that serve, once there are two other ones than `but`."""

    def look() -> set[int]:
        found = {pid for pid in family(parent) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()} - {but}
        return found if len(found) == 2 else set()

    return until(look)
