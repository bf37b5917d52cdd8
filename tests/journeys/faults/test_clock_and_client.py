"""The clock is set back while runs come in; the client is killed while the service comes and goes: nothing is lost."""

import json
import random
import subprocess
import sys
import time
from pathlib import Path

import httpx2
import numpy as np

from service.run_files.json_run import read_run
from service.web.answers import to_json
from service.workflows.ingest_run import ingest
from tests.journeys.faults.test_kills import findings, kills, stored
from tests.service.workflows.benches import CLUTCH, Bench, body
from tests.support import ONCE, Server, stationary

#: The clock goes on, is set back by a year, and then past where it was.
CLOCK = (
    "2026-11-02T10:00:00",
    "2026-11-02T11:00:00",
    "2025-11-02T11:00:00",
    "2025-11-02T11:00:01",
    "2026-12-01T00:00:00",
)


def test_a_clock_that_is_set_back_changes_no_answer_and_loses_no_run(tmp_path: Path) -> None:
    sent = [body("test", f"r{index}", 1000.0 * index) for index in range(len(CLOCK))]
    right, set_back = Bench(tmp_path / "right.db"), Bench(tmp_path / "set-back.db")
    for run, moment in zip(sent, CLOCK, strict=True):
        right.send(run)
        receipt, _ = ingest(set_back.database, CLUTCH, read_run(to_json(run)), received_at=f"{moment}+00:00")
        assert receipt["state"] == "accepted"
    ours, theirs = set_back.answers(), right.answers()
    different = [name for name in theirs if ours[name] != theirs[name]]
    assert different == ["runs"]  # they say when they arrived
    assert [run["run_id"] for run in ours["runs"]] == [run["run_id"] for run in theirs["runs"]]
    for bench in (right, set_back):
        bench.close()
    content = stored(tmp_path / "set-back.db")
    assert len(content) == len(CLOCK)
    assert content == stored(tmp_path / "right.db")
    assert findings(tmp_path / "set-back.db") == []


@kills(4, 50)
def test_what_a_client_that_is_killed_sends_to_a_service_that_comes_and_goes_arrives(
    tmp_path: Path, number: int
) -> None:
    """`push` of a folder is started again after each kill, as a rig's shift would: every run is there once, bit for bit."""
    rng = random.Random(number)  # noqa: S311 - moments, not secrets
    folder, path = tmp_path / "runs", tmp_path / "clutchlife.db"
    folder.mkdir()
    sent = {}
    for index in range(number):
        run = stationary(100 * index, run_id=f"r{index}", pressures=(4.0, 6.0))
        (folder / f"{index:03}.json").write_text(json.dumps(run))
        sent[CLUTCH, f"r{index}"] = {name: np.array(column).tobytes() for name, column in run["channels"].items()}
    server = Server(path, loaded=True)
    server.start()
    ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": CLUTCH})
    push = [sys.executable, "-m", "service.cli.main", "push", str(folder), "--clutch", CLUTCH, "--url", server.url]
    push += ["--spool", str(tmp_path / "spool"), "--patience", "60"]
    for kill in range(number):
        client = subprocess.Popen(push, stdout=subprocess.DEVNULL)
        time.sleep(rng.uniform(0.3, 1.5))
        if kill % 2:
            server.kill()
            time.sleep(rng.uniform(0.0, 0.5))
            client.kill()
            server.start()
        else:
            client.kill()
        client.wait()
    done = subprocess.run(push, capture_output=True, text=True, check=False)
    assert (done.returncode, "0 refused" in done.stdout) == (0, True), done.stdout + done.stderr
    with httpx2.Client(base_url=server.url, timeout=60) as http:
        page = http.get(f"/v1/clutches/{CLUTCH}/runs", params={"limit": 1000}).json()
    assert [item["run_id"] for item in page["items"]] == [f"r{index}" for index in range(number)]
    server.stop()
    assert stored(path) == sent
    assert findings(path) == []
