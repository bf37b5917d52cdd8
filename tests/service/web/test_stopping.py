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

from tests.lab.benchmarks.memory import family
from tests.support import ONCE, Server, stationary

RUNS = "/v1/clutches/c{}/runs"


@pytest.mark.parametrize(
    "everywhere", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["the service", "all its processes"]
)
def test_a_stop_amid_posts_ends_with_0_and_finishes_what_was_on_its_way(tmp_path: Path, everywhere: bool) -> None:
    """Six rigs post as fast as they can, two to each of three clutches; what was answered 201 is there after the next start,
    and nothing is refused."""
    server = Server(tmp_path / "a.db")
    server.start()
    asked: set[str] = set()
    answers: dict[str, int] = {}

    def post(rig: int) -> None:
        with httpx2.Client(base_url=server.url, timeout=30) as http:
            for number in range(300):
                body = stationary(100.0 * number + rig, run_id=f"rig{rig}-{number}")
                asked.add(body["run_id"])
                try:
                    answers[body["run_id"]] = http.post(RUNS.format(rig % 3), json=body).status_code
                except httpx2.TransportError:  # it takes no more connections
                    return

    for number in range(3):
        assert ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": f"c{number}"}).status_code == 201
    rigs = [threading.Thread(target=post, args=(number,)) for number in range(6)]
    for rig in rigs:
        rig.start()
    while len(answers) < 12 and any(rig.is_alive() for rig in rigs):
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
    assert len(answers) < 1800, "it was not stopped"
    server.loaded = True
    server.start()
    pages = [ONCE.get(f"{server.url}{RUNS.format(number)}?limit=1000").json()["items"] for number in range(3)]
    stored = {item["run_id"] for items in pages for item in items}
    assert server.stop() == 0
    assert answers.keys() <= stored


@pytest.mark.slow
def test_a_stop_before_the_service_listens_ends_with_0(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "service.cli.main", "serve", "--database", f"sqlite:///{tmp_path / 'a.db'}"]
    starting = subprocess.Popen([*command, "--port", "0"], stderr=subprocess.PIPE, text=True)
    assert "settings" in starting.stderr.readline()
    starting.terminate()
    _, said = starting.communicate(timeout=60)
    assert starting.returncode == 0
    assert "Traceback" not in said
