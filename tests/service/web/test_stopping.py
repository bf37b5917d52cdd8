"""The service is asked to stop: what it has acknowledged is stored, and what was on its way is finished."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import httpx2
import pytest

from tests.benchmarks.memory import family
from tests.support import ONCE, Server, stationary

RUNS = "/v1/clutches/c1/runs"


@pytest.mark.parametrize(
    "everywhere", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["the service", "all its processes"]
)
def test_a_stop_amid_posts_ends_with_0_and_finishes_what_was_on_its_way(tmp_path: Path, everywhere: bool) -> None:
    """Three rigs post as fast as they can; what was answered 201 is there after the next start, and nothing is refused."""
    server = Server(tmp_path / "a.db")
    server.start()
    asked: set[str] = set()
    answers: dict[str, int] = {}

    def post(rig: int) -> None:
        with httpx2.Client(base_url=server.url, timeout=30) as http:
            for number in range(500):
                body = stationary(100.0 * number + rig, run_id=f"rig{rig}-{number}")
                asked.add(body["run_id"])
                try:
                    answers[body["run_id"]] = http.post(RUNS, json=body).status_code
                except httpx2.TransportError:  # it takes no more connections
                    return

    assert ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
    rigs = [threading.Thread(target=post, args=(number,)) for number in range(3)]
    for rig in rigs:
        rig.start()
    while len(answers) < 6 and any(rig.is_alive() for rig in rigs):
        time.sleep(0.01)
    on_their_way = set(asked).difference(answers)
    time.sleep(0.2)  # by then the service has them
    for pid in family(server.pid) if everywhere else [server.pid]:
        os.kill(pid, signal.SIGTERM)
    assert server.exit_code(30) == 0
    for rig in rigs:
        rig.join()
    assert set(answers.values()) == {201}
    assert on_their_way, "nothing was on its way"
    assert on_their_way <= answers.keys()
    assert len(answers) < 1500, "it was not stopped"
    server.loaded = True
    server.start()
    stored = {item["run_id"] for item in ONCE.get(f"{server.url}{RUNS}?limit=1000").json()["items"]}
    assert server.stop() == 0
    assert answers.keys() <= stored


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
