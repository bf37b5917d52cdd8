"""`clutchlife import`: a rig's first file is asked about once, its second is sent without a question."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.cli.options import EX_DATAERR
from tests.service.cli.conftest import Terminal
from tests.service.web.test_import_preview import german


def test_only_a_first_file_is_asked_about(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    first, second = tmp_path / "Stat_7000.csv", tmp_path / "Stat_8000.csv"
    first.write_bytes(german(7000))
    second.write_bytes(german(8000))
    # the torque is the first column that is left out, the kind the first of those that fit, the cycles, send, the name
    shown = terminal("import", first, "--clutch", "c1", answers="1\n1\n7000\ny\nbench-3\n")
    assert "Column of torque_nm" in shown
    assert "saved as rig profile bench-3; file names such as Stat_{cycles}.csv give the cycles" in shown
    assert "3 curves" in shown
    again = terminal("import", second, "--clutch", "c1", "--yes")
    assert "read by the rig profile bench-3" in again
    receipts = client.get("/v1/clutches/c1/runs").json()["items"]
    assert [(receipt["cycles"], receipt["file"]["filename"], receipt["file"]["rig"]) for receipt in receipts] == [
        (7000, "Stat_7000.csv", "bench-3"),
        (8000, "Stat_8000.csv", "bench-3"),
    ]


def test_a_pushed_file_is_the_same_run_when_imported(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    file = tmp_path / "Stat_7000.csv"
    file.write_bytes(german(7000, torque="Drehmoment"))
    as_pushed = {"kind": "stationary_stribeck", "cycles": "7000.0", "filename": file.name}
    assert client.post("/v1/clutches/c1/runs/file", params=as_pushed, content=file.read_bytes()).status_code == 201
    kind = ("--kind", "stationary_stribeck", "--cycles", "7000")
    assert "stored before" in terminal("import", file, "--clutch", "c1", *kind, "--yes")
    assert len(client.get("/v1/clutches/c1/runs").json()["items"]) == 1


def test_what_is_not_sent_leaves_no_profile(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    file = tmp_path / "Stat_7000.csv"
    file.write_bytes(german(7000))
    shown = terminal("import", file, "--clutch", "c1", "--save", "bench-3", answers="1\n1\n7000\nn\n")
    assert "rig profile" not in shown
    assert client.get("/v1/rigs").json()["items"] == client.get("/v1/clutches/c1/runs").json()["items"] == []


def test_options_say_what_no_title_does_and_are_kept(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    """Titles that name no channel, thousands that may be decimals, and a mark of missing values: no question is left."""
    file = tmp_path / "Prüfung 3.csv"
    rows = [f"{p};{n};{m}" for p in (4, 5) for n, m in zip((20, 520, 800, "1.100"), (21, 22, -9999, 20), strict=True)]
    file.write_text("\n".join(["Kanal a [bar];Kanal b;Kanal c [Nm]", *rows]) + "\n", encoding="utf-8")
    given = ("--clutch", "c1", "--kind", "stationary_stribeck", "--cycles", "3", "--yes", "--save", "odd")
    columns = "pressure_bar:Kanal a,speed_rpm:Kanal b [1/min],torque_nm:Kanal c"
    assert "decimal=" in terminal("import", file, *given, "--map", columns, code=EX_DATAERR)
    assert "missing=-9999" in terminal("import", file, *given, "--map", columns, "--decimal", ",", code=EX_DATAERR)
    terminal("import", file, *given, "--map", columns, "--decimal", ",", "--missing", "-9999")
    (item,) = client.get("/v1/clutches/c1/runs").json()["items"]
    run = client.get(f"/v1/clutches/c1/runs/{item['run_id']}").json()
    assert run["channels"]["speed_rpm"] == [20, 520, 1100, 20, 520, 1100]
    assert "invalid_samples" in [warning["code"] for warning in run["warnings"]]
    saved = client.get("/v1/rigs/odd").json()
    assert (saved["decimal"], saved["missing"], saved["columns"][1]["unit"]) == (",", "-9999", "1/min")


def test_what_is_missing_ends_an_import_with_yes(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    file = tmp_path / "Stat_7000.csv"
    file.write_bytes(german(7000))
    shown = terminal("import", file, "--clutch", "c1", "--yes", "--cycles", "7000", code=EX_DATAERR)
    assert "still missing: torque_nm, kind" in shown
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []


def test_a_run_read_by_a_wrong_factor_is_read_again(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "Stat_7000.csv").write_bytes(german(7000))
    terminal("import", tmp_path / "Stat_7000.csv", "--clutch", "c1", answers="1\n1\n7000\ny\nbench-3\n")
    run = client.get("/v1/clutches/c1/runs").json()["items"][0]["run_id"]
    saved = ("version", "saved_at", "saved_by")
    profile = {name: value for name, value in client.get("/v1/rigs/bench-3").json().items() if name not in saved}
    columns = [each | ({"scale": 0.1} if each["channel"] == "torque_nm" else {}) for each in profile["columns"]]
    assert client.put("/v1/rigs/bench-3", json=profile | {"columns": columns}).status_code == 200
    before = client.get(f"/v1/clutches/c1/runs/{run}").json()["channels"]["torque_nm"]
    terminal("correct", "c1", run, "--rig", "bench-3", "--reason", "the amplifier was set to ten times")
    after = client.get(f"/v1/clutches/c1/runs/{run}").json()["channels"]["torque_nm"]
    assert after == pytest.approx([0.1 * value for value in before])
    refused = terminal("correct", "c1", run, "--reason", "nothing is given", code=64)
    assert "--rig" in refused
