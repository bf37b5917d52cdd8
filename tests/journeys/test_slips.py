"""Slips on the command line: seen, mended, exported; and a life that was mended is answered as one without slips."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from tests.support import Server, clutchlife, serving, stationary

PRESSURES = (4.0, 6.0)


def post(
    server: Server, clutch: str, cycles: float, *, run_id: str, sent: float | None = None, gain: float = 1.0
) -> Any:
    body = stationary(cycles, run_id=run_id, pressures=PRESSURES)
    body["channels"]["torque_nm"] = [gain * torque for torque in body["channels"]["torque_nm"]]
    body["cycles"] = cycles if sent is None else sent
    return server.http.post(f"/v1/clutches/{clutch}/runs", json=body).json()


def life(server: Server, clutch: str) -> Any:
    answer = server.http.get(f"/v1/clutches/{clutch}/remaining-useful-life").json()
    return {name: value for name, value in answer.items() if name != "revision"}


@pytest.mark.slow
def test_slips_are_seen_and_mended_in_the_terminal(server: Server, tmp_path: Path) -> None:
    server.http.post("/v1/clutches", json={"clutch_id": "c1"})
    at = ("--url", server.url)
    for cycles in (0.0, 1000.0, 2000.0):
        post(server, "c1", cycles, run_id=f"r{cycles:g}")
    whole = life(server, "c1")
    assert "c1 has no held runs" in clutchlife("runs", "c1", "--held", *at)
    assert post(server, "c1", 3000.0, run_id="odd", gain=60.0)["state"] == "held"  # a mean COF of 3
    while_held = life(server, "c1")
    assert while_held["remaining_cycles"] == whole["remaining_cycles"]
    assert while_held["held_runs"]["count"] == 1
    held = clutchlife("runs", "c1", "--held", *at)
    assert "held" in held
    assert "odd" in held
    assert "mean COF" in held
    assert "withdrawn" in clutchlife("withdraw", "c1", "odd", "--reason", "in lbf", *at)
    assert "held" in clutchlife("withdraw", "c1", "odd", "--undo", "--reason", "look again", *at)
    assert "accepted" in clutchlife("confirm", "c1", "odd", *at)
    assert life(server, "c1") != whole
    assert "c1 has no held runs" in clutchlife("confirm", "c1", "--all", *at)
    assert "name the runs, or use --all" in clutchlife("confirm", "c1", "odd", "--all", *at, code=64)
    clutchlife("withdraw", "c1", "odd", "--reason", "in lbf", *at)
    assert life(server, "c1") == whole
    post(server, "c1", 4000.0, run_id="typo", sent=4001.0)
    assert "sent as 4001" in clutchlife("correct", "c1", "typo", "--cycles", "4000", "--reason", "a slip", *at)
    assert "sent as 4001" in clutchlife("runs", "c1", *at)
    states = [item["state"] for item in json.loads(clutchlife("runs", "c1", "--json", *at))]
    assert sorted(states) == ["accepted"] * 4 + ["withdrawn"]
    edit = ("edit", "c1", "--set", "end_of_life.cof_fraction=0.4", "--set", "fluid=CVTF", "--reason", "a letter", *at)
    assert 'fluid = "CVTF"' in clutchlife(*edit)
    assert life(server, "c1")["criterion"]["fraction"] == 0.4
    assert "FIELD=VALUE" in clutchlife("edit", "c1", "--set", "fluid", "--reason", "x", *at, code=64)
    assert "there is no clutch" in clutchlife("archive", "nobody", *at, code=65)
    ended = clutchlife("end", "c1", "--note", "squeals", *at)
    assert "c1: ended at 4,000 cycles (worn)" in ended
    assert "ended at 4,000 cycles" in clutchlife("life", "c1", *at)
    run = re.search(r"clutchlife withdraw c1 (\S+) --reason", ended)
    assert "at 4000 cycles" in clutchlife("end", "c1", "--cycles", "5000", *at, code=65)
    assert "worn or other" in clutchlife("end", "c1", "--reason", "tired", *at, code=64)
    assert "withdrawn" in clutchlife("withdraw", "c1", run[1], "--reason", "it does not squeal", *at)
    assert "ended at" not in clutchlife("life", "c1", *at)
    assert "archived" in clutchlife("archive", "c1", "--reason", "worn out", *at)
    assert "in use" in clutchlife("archive", "c1", "--undo", *at)
    trail = clutchlife("changes", "c1", *at)
    assert "local  correct typo (cycles 4001 -> 4000): a slip" in trail
    actions = [item["action"] for item in json.loads(clutchlife("changes", "c1", "--json", *at))]
    assert actions == [
        "unarchive", "archive", "withdraw", "edit", "correct", "withdraw", "confirm", "restore", "withdraw", "hold",
    ]  # fmt: skip
    exported_and_pushed_elsewhere(server, tmp_path)


def test_all_that_are_held_of_one_cause_are_confirmed_in_one_line(server: Server) -> None:
    server.http.post("/v1/clutches", json={"clutch_id": "c2"})
    at = ("--url", server.url)
    for cycles in (0.0, 1000.0, 2000.0):
        post(server, "c2", cycles, run_id=f"r{cycles:g}")
    odd = [post(server, "c2", cycles, run_id=f"odd-{cycles:g}", gain=60.0) for cycles in (3000.0, 4000.0)]
    assert [receipt["state"] for receipt in odd] == ["held", "held"]
    for command in ("status", "life", "degradation"):
        assert "2 runs are held" in clutchlife(command, "c2", *at, code=1 if command == "status" else 0)
    assert "2 runs are held" in clutchlife("watch", "c2", "--looks", "1", *at)
    (line,) = [line for line in clutchlife("list", *at).splitlines() if line.lstrip("│| ").startswith("c2")]
    assert "2" in line.split()
    assert "no runs held for dead_channel" in clutchlife("confirm", "c2", "--doubt", "dead_channel", *at)
    printed = clutchlife("confirm", "c2", "--doubt", odd[0]["doubts"][0]["code"], "--reason", "a new lining", *at)
    assert [line.split()[1] for line in printed.splitlines()] == ["accepted", "accepted"]
    assert life(server, "c2")["held_runs"] is None


def test_a_clutch_without_tests_is_exported(server: Server, tmp_path: Path) -> None:
    server.http.post("/v1/clutches", json={"clutch_id": "new"})
    clutchlife("export", "new", "--out", tmp_path, "--url", server.url)
    tables = {path.stem for path in (tmp_path / "results" / "tables").iterdir()}
    assert {"runs", "degradation"} <= tables
    assert "surfaces" not in tables
    assert (tmp_path / "results" / "about.json").exists()


def exported_and_pushed_elsewhere(server: Server, tmp_path: Path) -> None:
    """An export holds what counts; what was sent and does not is beside it, and the audit trail."""
    folder = tmp_path / "export"
    clutchlife("export", "c1", "--out", folder, "--url", server.url)
    aside = {path.name[6:]: json.loads(path.read_bytes())["cycles"] for path in (folder / "as-sent").iterdir()}
    taken_back = [name for name in aside if name.startswith("maintenance-")]
    assert aside == {"odd.json": 3000, "typo.json": 4001, taken_back[0]: 4000}
    trail = json.loads((folder / "results" / "changes.json").read_bytes())
    assert trail[-1]["action"] == "hold"
    assert {item["run_id"]: item["state"] for item in json.loads((folder / "results" / "runs.json").read_bytes())}[
        "odd"
    ] == "withdrawn"
    with serving(tmp_path / "second.db", loaded=True) as second:
        spool = ("--spool", tmp_path / "spool")
        assert "4 stored" in clutchlife("push", folder, "--clutch", "c1", "--url", second.url, *spool)
        assert life(second, "c1") == life(server, "c1")
