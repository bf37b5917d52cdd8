"""The service is asked to stop: what it has acknowledged is stored, and what was on its way is finished."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path

import httpx2
import pytest

from storage import runs
from storage.engine.opening import open_database
from tests.benchmarks.memory import family
from tests.support import ONCE, Server, stationary

RUNS = "/v1/clutches/c1/runs"


def test_a_stop_amid_posts_ends_with_0_and_keeps_every_acknowledged_run(tmp_path: Path) -> None:
    """Three rigs post as fast as they can; what was answered 201 is there after the next start, and nothing is refused."""
    server = Server(tmp_path / "a.db")
    server.start()
    acknowledged: list[str] = []
    refused: list[int] = []

    def post(rig: int) -> None:
        with httpx2.Client(base_url=server.url, timeout=30) as http:
            for number in range(500):
                body = stationary(100.0 * number + rig, run_id=f"rig{rig}-{number}")
                try:
                    status = http.post(RUNS, json=body).status_code
                except httpx2.TransportError:  # it takes no more connections
                    return
                (acknowledged if status == 201 else refused).append(body["run_id"] if status == 201 else status)

    assert ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
    rigs = [threading.Thread(target=post, args=(number,)) for number in range(3)]
    for rig in rigs:
        rig.start()
    while len(acknowledged) < 6 and any(rig.is_alive() for rig in rigs):
        time.sleep(0.01)
    assert server.stop() == 0
    for rig in rigs:
        rig.join()
    assert refused == []
    assert len(acknowledged) < 1500, "it was not stopped"
    server.loaded = True
    server.start()
    stored = {item["run_id"] for item in ONCE.get(f"{server.url}{RUNS}?limit=1000").json()["items"]}
    assert server.stop() == 0
    assert set(acknowledged) <= stored


@pytest.mark.slow
def test_a_stop_before_the_service_listens_ends_with_0(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "service.cli.main", "serve", "--database", f"sqlite:///{tmp_path / 'a.db'}"]
    starting = subprocess.Popen([*command, "--port", "0"], stderr=subprocess.PIPE, text=True)
    assert starting.stderr is not None
    assert "settings" in starting.stderr.readline()
    starting.terminate()
    _, said = starting.communicate(timeout=60)
    assert starting.returncode == 0
    assert "Traceback" not in said


@pytest.mark.slow
def test_a_stop_of_all_processes_finishes_what_was_on_its_way(tmp_path: Path) -> None:
    server = Server(tmp_path / "a.db")
    server.start()
    answers: dict[str, int] = {}
    asked: list[str] = []
    with httpx2.Client(base_url=server.url, timeout=30) as http:
        assert http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201

        def post() -> None:
            for number in range(500):
                body = stationary(100.0 * number, run_id=f"r{number}")
                asked.append(body["run_id"])
                try:
                    answers[body["run_id"]] = http.post(RUNS, json=body).status_code
                except httpx2.TransportError:  # it takes no more connections
                    return

        rig = threading.Thread(target=post)
        rig.start()
        while len(answers) < 3:
            time.sleep(0.01)
        while len(asked) == len(answers):
            time.sleep(0.001)
        time.sleep(0.2)  # by then the service has the request
        on_its_way = asked[-1]
        for pid in family(server.pid):
            os.kill(pid, signal.SIGTERM)
        rig.join()
    assert server.exit_code(30) == 0
    assert answers[on_its_way] == 201
    assert set(answers.values()) == {201}
    with closing(open_database(f"sqlite:///{server.database}")) as database, database.reading() as connection:
        stored = {row.run_id for row in runs.in_order(connection, "c1")}
    assert {run_id for run_id, status in answers.items() if status == 201} <= stored
    assert len(stored) < 500, "it was not stopped"
