"""The service is asked to stop: what it has acknowledged is stored, and what was on its way is finished."""

import os
import signal
import threading
import time
from contextlib import closing
from pathlib import Path

import httpx2
import pytest

from storage import runs
from storage.engine.database import open_database
from tests.support import Server, stationary

RUNS = "/v1/clutches/c1/runs"


def family(pid: int) -> list[int]:
    """A process and all below it, as what stops a whole unit sees them."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except FileNotFoundError:  # it has just ended
            continue
    found = [pid]
    for each in found:
        found += [child for child, parent in parents.items() if parent == each]
    return found


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
        time.sleep(0.01)  # by then the service has the request
        on_its_way = asked[-1]
        for pid in family(server.pid):
            os.kill(pid, signal.SIGTERM)
        rig.join()
    assert server.exit_code(30) in (0, -signal.SIGTERM)
    assert answers[on_its_way] == 201
    assert set(answers.values()) == {201}
    with closing(open_database(f"sqlite:///{server.database}")) as database, database.reading() as connection:
        stored = {row.run_id for row in runs.in_order(connection, "c1")}
    assert {run_id for run_id, status in answers.items() if status == 201} <= stored
    assert len(stored) < 500, "it was not stopped"
