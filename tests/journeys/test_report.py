"""`clutchlife report`: what is in its files, printed with a key, sent to a receiver, and again on a schedule."""

import re
import subprocess
import sys
from pathlib import Path

import openpyxl
import pytest

from tests.browser.driving import system
from tests.browser.lives import post, worn
from tests.service.alarms.receiving import receiving
from tests.support import Server, stationary


def clutchlife(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "service.cli.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_clutches_and_alarms_are_in_a_workbook_which_a_receiver_gets_on_a_schedule(
    server: Server, tmp_path: Path
) -> None:
    server.http.post("/v1/alarms", json={"name": "any", "quantity": "held_runs", "above": 0}).raise_for_status()
    worn(server.http, "bench", last=3000)
    odd = stationary(4500)
    odd["channels"]["torque_nm"] = [100 * value for value in odd["channels"]["torque_nm"]]
    assert post(server.http, "bench", odd)["state"] == "held"
    server.http.post("/v1/clutches", json={"clutch_id": "waiting"}).raise_for_status()
    with receiving() as receiver:
        where = ("--out", str(tmp_path / "a"), "--url", server.url, "--to", receiver.url)
        done = clutchlife("report", *where, "--every", "0.001", "--times", "2")
        assert (done.returncode, done.stderr) == (0, "")
        (path,) = {Path(line) for line in done.stdout.split()}
        (_, headers, body), again = receiver.requests
    assert re.fullmatch(r"clutchlife-\d{4}-\d\d-\d\d\.xlsx", path.name)
    assert body == again[2] == path.read_bytes()
    assert path.name in headers["Content-Disposition"]
    book = openpyxl.load_workbook(path)
    clutches = {row[0]: row for row in book["Clutches"].iter_rows(min_row=2, values_only=True)}
    said = server.http.get("/v1/clutches/bench").json()
    assert clutches["bench"][2:5] == (said["action"], said["headline"], said["summary"]["at_least"])
    assert clutches["bench"][6] == said["runs"]
    assert clutches["waiting"][6:] == (0, 0, None)
    alarms = server.http.get("/v1/alarms/events").json()["items"]
    assert book["Alarms"].max_row == 1 + len(alarms) > 1


def test_a_report_that_fails_is_tried_again_at_the_next_time_or_ends_the_command(
    server: Server, tmp_path: Path
) -> None:
    with receiving() as receiver:
        receiver.status = 503
        options = ("report", "--out", str(tmp_path), "--url", server.url, "--to", receiver.url)
        once, twice = clutchlife(*options), clutchlife(*options, "--every", "0.001", "--times", "2")
    assert once.returncode != 0
    assert "the receiver answered 503" in once.stderr
    assert twice.returncode == 0
    assert twice.stderr.count("the receiver answered 503") == 2


@pytest.mark.browser
@pytest.mark.skipif(system() is None, reason="the command looks for a browser on the path")
def test_each_clutch_is_printed_on_a_page_with_a_key_too(server: Server, tmp_path: Path) -> None:
    worn(server.http, "bench", last=3000)
    server.http.post("/v1/clutches", json={"clutch_id": "waiting"}).raise_for_status()
    made = clutchlife("key", "create", "--scope", "read", "--database", server.address)
    key = made.stdout.split()[-1]
    refused = clutchlife("report", "--out", str(tmp_path / "a"), "--url", server.url)
    assert refused.returncode != 0
    done = clutchlife("report", "--pdf", "--out", str(tmp_path / "b"), "--url", server.url, "--key", key)
    assert (done.returncode, done.stderr) == (0, "")
    book, *pages = sorted((tmp_path / "b").iterdir(), key=lambda path: path.suffix, reverse=True)
    assert book.suffix == ".xlsx"
    assert {path.name.split("-")[0] for path in pages} == {"bench", "waiting"}
    for path in pages:
        assert len(re.findall(rb"/Type\s*/Page[^s]", path.read_bytes())) == 1, path
