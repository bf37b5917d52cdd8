"""Commands that ask a service, as an engineer types them in a terminal; the service is in this process."""

import csv
import io
import json
import zipfile
from collections.abc import Callable
from contextlib import nullcontext
from importlib.metadata import version
from pathlib import Path
from time import gmtime

import pytest
import typer
from fastapi.testclient import TestClient
from python_calamine import CalamineWorkbook
from rich.table import Table

from service.cli import answers, options
from service.cli.clutches import _row
from service.cli.export import TABLES
from service.cli.options import EX_DATAERR, fail, out, print_line
from service.cli.sending import delivery, push
from service.cli.workbook import write_workbook
from service.client.clutchlife import Client
from tests.service.clients import clutchlife, post_run
from tests.service.web.routes.surfaces import png, sha256
from tests.service.web.test_import_preview import foreign, german
from tests.support import free_port, post_tests, stationary

Terminal = Callable[..., str]


@pytest.fixture
def terminal(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> Terminal:
    for module in (options, push):
        monkeypatch.setattr(module, "connect", lambda *_, **__: nullcontext(client))
    monkeypatch.setattr("service.client.clutchlife.client.connect", lambda *_, **__: client)
    monkeypatch.setattr(Client, "close", lambda _: None)
    return clutchlife


# --- What an engineer reads about a clutch: tables of the service's own answers.


DUTY = {"kind": "duty_cycles", "cycles": 3000, "duty": {"cycles": 3000, "energy_per_cycle_kj": 18}}
LIFE = "/v1/clutches/c1/remaining-useful-life"


@pytest.fixture
def aged(terminal: Terminal, client: TestClient) -> Terminal:
    """The terminal, whose service has seen a clutch for 3,000 cycles."""
    tests = [stationary(cycles, pressures=(5.0, 6.0)) for cycles in (0, 1000, 2000, 3000)]
    for number, run in enumerate([*tests, DUTY]):
        post_run(client, run | {"run_id": f"r{number}"})
    return terminal


def test_remaining_life_is_a_table_of_quantiles(aged: Terminal, client: TestClient) -> None:
    shown, answer = aged("life", "c1"), client.get(LIFE).json()
    assert "c1 at 3,000 cycles: " in shown
    assert "4 tests, method particle, model baseline" in shown
    assert " % of new; the end of life is at 50 %\n" in shown
    row = next(line for line in shown.splitlines() if line.startswith("remaining cycles"))
    median = answer["remaining_cycles"]["0.5"]
    assert ("over 1,000,000" if median is None else f"{median:,.0f}") in row
    assert json.loads(aged("life", "c1", "--json")) == answer
    assert "method grid" in aged("life", "c1", "--method", "grid", "--pressure", "5")
    assert "calibrated" not in shown
    calibrated = [(count, list(answers._lines(answer | {"ended_lives": count}))) for count in (1, 2)]
    assert all(f"calibrated on {count} ended" in "\n".join(lines) for count, lines in calibrated)
    rows = list(csv.DictReader(io.StringIO(aged("life", "c1", "--csv", "--at-cycles", "2000"))))
    assert {row["as_of_cycles"] for row in rows} == {"2000"}


def test_planned_duty_by_block_and_by_file_is_the_same(aged: Terminal, client: TestClient, tmp_path: Path) -> None:
    by_energy = {"severity": {"basis": "dissipated_energy"}, "reason": "its duty varies"}
    changed = client.patch("/v1/clutches/c1", json=by_energy)
    assert changed.status_code == 200, changed.text
    (tmp_path / "plan.json").write_text('{"programme": [{"cycles": 5000, "energy_per_cycle_kj": 36, "sd": 2}]}')
    shown = aged("life", "c1", "--block", "5000:36:2", "--pace", "120")
    assert shown == aged("life", "c1", "--plan", tmp_path / "plan.json", "--pace", "120")
    for words in ("remaining blocks", "under recent duty", "date, counted from 2", "120 cycles an hour, as planned"):
        assert words in shown, words
    answer = json.loads(aged("life", "c1", "--block", "5000:36:2", "--json"))
    # twice the energy of the blocks so far: half the cycles, by the middle of the distribution
    assert answer["block_severity"][0] == pytest.approx(2.0, rel=0.02)
    assert answer["pace_cycles_per_hour"] is None
    bound = answer["at_least"]
    for pace, days in ((120.0, "less than a day"), (bound / 35, "1 day"), (bound / 61, "2 days")):
        shown = aged("life", "c1", "--block", "5000:36:2", "--pace", pace)
        assert f"safe for {days} at the planned pace, counted from the last run on 2" in shown
    assert "counted from" not in aged("life", "c1", "--block", "5000:36:2")


def test_the_tables_hold_every_item_of_the_answer_on_a_line(aged: Terminal, client: TestClient) -> None:
    lines = aged("degradation", "c1").splitlines()
    items = client.get("/v1/clutches/c1/degradation").json()["items"]
    assert [line.split()[0] for line in lines[1 : 1 + len(items)]] == [item["quantity"] for item in items]
    assert next(csv.reader(io.StringIO(aged("degradation", "c1", "--csv"))))[0] == "quantity"
    assert "c1 has no loops" in aged("loops", "c1")
    course = aged("engagement", "c1", "--at-cycles", "1000")
    assert "c1 at 1,000 cycles, simulated: " in course
    assert "motor_torque_nm" in course
    assert json.loads(aged("engagement", "c1", "--json")) == client.get("/v1/clutches/c1/engagement").json()


def test_an_end_by_other_criteria_shows_how_probably_each_is_first(aged: Terminal, client: TestClient) -> None:
    slope = {"quantity": "slope", "pressure_bar": 5, "speed_rpm": 100}
    changed = {"end_of_life": {"criteria": [{"quantity": "mean_cof"}, slope]}, "reason": "it shudders"}
    assert client.patch("/v1/clutches/c1", json=changed).status_code == 200
    lines = aged("life", "c1").splitlines()
    heading = next(place for place, line in enumerate(lines) if line.startswith("criterion"))
    rows = [line.split() for line in lines[heading + 1 : heading + 3]]
    assert [row[0] for row in rows] == ["mean_cof", "slope"]
    assert rows[1][1:3] == ["5", "100"]
    assert lines[heading + 2].index("100") == lines[heading].index("rpm")
    reached = client.get(LIFE).json()["probability_of_reaching"]  # one of them is the first where any is reached
    assert sum(float(row[-2]) for row in rows) == pytest.approx(100.0 * reached, abs=1.1)
    alone = aged("life", "c1", "--quantity", "slope", "--pressure", "5")
    assert "slope" in alone
    assert "course" not in alone  # the course and the forecasts that were held are those of mean COF
    answer = json.loads(aged("life", "c1", "--quantity", "slope", "--pressure", "5", "--life", "1", "--json"))
    assert (answer["course"], answer["back_cast"], answer["life"]["number"]) == (None, None, 1)


def test_what_cannot_be_answered_is_refused_in_a_line(aged: Terminal) -> None:
    refused: list[tuple[tuple[str, ...], int, str]] = [
        (("life", "nobody"), 65, "there is no clutch"),
        (("life", "c1", "--query", "quantitty=slope"), 65, "quantitty is not an argument of this route"),
        (("life", "c1", "--query", "slope"), 64, "--query takes NAME=VALUE"),
        (("life", "c1", "--json", "--csv"), 64, "use --json or --csv"),
        (("life", "c1", "--pace", "120"), 64, "use --pace only with"),
        (("life", "c1", "--block", "5000"), 64, "--block takes CYCLES:KJ[:SD]"),
        (("life", "c1", "--block", "5000:20:30"), 65, "sd must not be larger than energy_per_cycle_kj"),
        (("life", "c1", "--plan", "nowhere.json"), 64, "nowhere.json"),
        (("life", "c1", "--block", "5000:20", "--csv"), 64, "--csv is not available for planned duty"),
        (("engagement", "c1", "--query", "points=5"), 65, "points is not an argument of this route"),
    ]
    for arguments, code, words in refused:
        assert words in aged(*arguments, code=code), arguments


# --- `clutchlife import`: a rig's first file is asked about once, its second is sent without a question.


def test_only_a_first_file_is_asked_about(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    first, second = tmp_path / "Stat_7000.csv", tmp_path / "Stat_8000.csv"
    first.write_bytes(german(7000))
    second.write_bytes(german(8000))
    # the cycles are suggested by the file's name; then the columns are confirmed, and the name of the rig
    shown = terminal("import", first, "--clutch", "c1", answers="\ny\nbench-3\n")
    assert "These columns are suggested, not certain (75%). Are they right?" in shown
    assert "saved as rig profile bench-3; file names such as Stat_{cycles}.csv give the cycles" in shown
    assert "3 curves" in shown
    again = terminal("import", second, "--clutch", "c1", "--yes")
    assert "read by the rig profile bench-3" in again
    receipts = client.get("/v1/clutches/c1/runs").json()["items"]
    assert [(receipt["cycles"], receipt["file"]["filename"], receipt["file"]["rig"]) for receipt in receipts] == [
        (7000, "Stat_7000.csv", "bench-3"),
        (8000, "Stat_8000.csv", "bench-3"),
    ]


def test_a_push_of_unknown_titles_shows_what_is_suggested(
    terminal: Terminal, client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(delivery, "connect", lambda *_, **__: nullcontext(client))
    file = tmp_path / "KL-4712_01500.csv"
    file.write_bytes(foreign())
    given = ("--clutch", "c1", "--kind", "stationary_stribeck", "--cycles", "1500", "--spool", tmp_path / "spool")
    shown = terminal("push", file, *given, code=EX_DATAERR)
    assert "suggested (80%): torque_nm from Couple FZG" in shown
    assert "first row: pressure_bar 5, speed_rpm 20, torque_nm 20.48" in shown
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []


def test_a_pushed_file_is_the_same_run_when_imported(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    file = tmp_path / "Stat_7000.csv"
    file.write_bytes(german(7000, torque="Drehmoment"))
    as_pushed = {"kind": "stationary_stribeck", "cycles": "7000.0", "filename": file.name}
    assert client.post("/v1/clutches/c1/runs/file", params=as_pushed, content=file.read_bytes()).status_code == 201
    kind = ("--kind", "stationary_stribeck", "--cycles", "7000")
    assert "stored before" in terminal("import", file, "--clutch", "c1", *kind, "--yes")
    assert len(client.get("/v1/clutches/c1/runs").json()["items"]) == 1


def test_what_is_not_sent_or_not_known_leaves_nothing(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    file = tmp_path / "Stat_7000.csv"
    file.write_bytes(german(7000))
    shown = terminal("import", file, "--clutch", "c1", "--save", "bench-3", answers="7000\nn\n")
    assert "rig profile" not in shown
    shown = terminal("import", file, "--clutch", "c1", "--yes", "--cycles", "7000", code=EX_DATAERR)
    assert "no column is known as torque_nm; suggested (75%): torque_nm from Mz," in shown
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


def test_a_run_read_by_a_wrong_factor_is_read_again(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "Stat_7000.csv").write_bytes(german(7000))
    terminal("import", tmp_path / "Stat_7000.csv", "--clutch", "c1", answers="\ny\nbench-3\n")
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


# --- Inspections: sent with their photographs, listed, exported.


LIST = "/v1/clutches/c1/inspections"


def test_photographs_are_sent_and_repeated_safely(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(1))
    (tmp_path / "b.PNG").write_bytes(png(2))
    inspect = ("inspect", "c1", "--cycles", 11000, "--ra", 1.94, "--rsk", -3.4, "--lining", "side A")
    photographs = ("--at", "2026-11-02T08:00:00", "--photo", tmp_path / "a.png", "--photo", tmp_path / "b.PNG")
    for _ in range(2):
        shown = terminal(*inspect, *photographs)
        assert all(words in shown for words in ("11,000", "side A", "1.94", "-3.4", "accepted"))
        assert "withdrawn" not in shown
        (stored,) = client.get(LIST).json()["items"]
        assert [photograph["photograph_id"] for photograph in stored["photographs"]] == [sha256(png(1)), sha256(png(2))]
        assert stored["performed_at"].startswith("2026-11-02T08:00:00")
    assert stored["inspection_id"] in terminal("inspections", "c1")
    assert json.loads(terminal("inspections", "c1", "--json")) == [stored]
    address = f"{LIST}/{stored['inspection_id']}"
    assert client.post(f"{address}/withdraw", json={"reason": "another disc"}).status_code == 200
    again = terminal(*inspect, *photographs)
    assert f"{stored['inspection_id']} was stored earlier and then withdrawn: it stays withdrawn" in again
    assert client.get(address).json()["state"] == "withdrawn"


def test_what_is_no_photograph_is_refused_unsent(terminal: Terminal, tmp_path: Path) -> None:
    (tmp_path / "a.gif").write_bytes(b"GIF89a")
    inspect = ("inspect", "c1", "--cycles", 0, "--ra", 9.5, "--photo")
    assert "the name of a photograph must end in .png" in terminal(*inspect, tmp_path / "a.gif", code=64)
    assert "does not exist" in terminal(*inspect, tmp_path / "b.png", code=64)
    assert "give roughness_um" in terminal("inspect", "c1", "--cycles", 0, code=65)
    assert "c1 has no inspections" in terminal("inspections", "c1")


def test_an_export_holds_what_counts_what_was_sent_inspections_and_photographs(
    terminal: Terminal, client: TestClient, tmp_path: Path
) -> None:
    """The same photograph twice; the later inspection is of that alone."""
    (tmp_path / "a.png").write_bytes(png())
    terminal("inspect", "c1", "--cycles", 0, "--ra", 9.5, "--photo", tmp_path / "a.png")
    terminal("inspect", "c1", "--cycles", 1000, "--photo", tmp_path / "a.png")
    for cycles, name in ((0, "right"), (1001, "typo"), (2000, "slip")):
        post_run(client, stationary(cycles, run_id=name, pressures=(5.0,)))
    client.patch("/v1/clutches/c1/runs/typo", json={"cycles": 1000, "reason": "a typing error"})
    client.post("/v1/clutches/c1/runs/slip/withdraw", json={"reason": "another clutch's"})
    terminal("export", "c1", "--out", tmp_path / "export")
    counting, sent = (
        {path.name.partition("-")[2]: json.loads(path.read_bytes())["cycles"] for path in folder.glob("0*.json")}
        for folder in (tmp_path / "export", tmp_path / "export" / "as-sent")
    )
    assert counting == {"right.json": 0, "typo.json": 1000}
    assert sent == {"typo.json": 1001, "slip.json": 2000}
    results = tmp_path / "export" / "results"
    inspections = client.get(LIST).json()["items"]
    assert json.loads((results / "inspections.json").read_text()) == inspections
    assert {each["note"] for each in inspections} == {"", "photographs"}
    (file,) = (results / "photographs").iterdir()
    assert (file.name, file.read_bytes()) == (f"{sha256(png())}.png", png())


# --- An export says what it is of, has every table as spreadsheets take it, and may be one archive.


def test_a_clutch_is_one_archive_with_its_tables(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    post_tests(client, 0.0, 1000.0, 2000.0, 3000.0)
    archive = tmp_path / "out" / "c1.zip"
    terminal("export", "c1", "--out", archive, "--archive")
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(tmp_path / "unpacked")
    results = tmp_path / "unpacked" / "c1" / "results"
    about = json.loads((results / "about.json").read_text(encoding="utf-8"))
    assert about["revision"] == client.get("/v1/clutches/c1").json()["revision"]
    assert about["settings"]["clutch_id"] == "c1"
    assert about["release"]
    assert [run["cycles"] for run in about["data"]] == [0, 1000, 2000, 3000]
    assert all(len(run["content_sha256"]) == 64 for run in about["data"])
    book = CalamineWorkbook.from_path(str(results / "tables.xlsx"))
    assert book.sheet_names == list(TABLES)
    for name in TABLES:
        rows = list(csv.reader((results / "tables" / f"{name}.csv").read_text(encoding="utf-8").splitlines()))
        sheet = book.get_sheet_by_name(name).to_python()
        assert len(sheet) == len(rows), name
        assert [str(cell) for cell in sheet[0]] == rows[0], name
    runs = book.get_sheet_by_name("runs").to_python()
    assert runs[2][runs[0].index("cycles")] == 1000.0


def test_a_workbook_computes_nothing_takes_any_text_and_is_the_same_at_any_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, written = tmp_path / "a.xlsx", []
    for seconds in (1_700_000_000.0, 1_800_000_000.0):
        monkeypatch.setattr("time.time", lambda at=seconds: at)
        monkeypatch.setattr("time.localtime", lambda _=None, at=seconds: gmtime(at))
        write_workbook(path, {"x" * 40: [["=1+1", "1e3", "", "a<b & \x00c", "1_000", "nan"]]})
        written.append(path.read_bytes())
    assert written[0] == written[1]
    book = CalamineWorkbook.from_path(str(path))
    assert book.sheet_names == ["x" * 31]
    assert book.get_sheet_by_index(0).to_python() == [["=1+1", 1000.0, "", "a<b & c", "1_000", "nan"]]


# --- A working day: register, list, status, watch, alarms; what a mistyped name leaves behind.


@pytest.fixture
def day(terminal: Terminal, client: TestClient) -> Terminal:
    """The terminal, whose service has a clutch that is fine, one that is worn, and `c1` without a run."""
    for name, end in (("worn", 4000), ("fine", 1e6)):
        client.post("/v1/clutches", json={"clutch_id": name})
        for cycles in (0.0, 1000.0, 2000.0, 3000.0):
            post_run(client, stationary(cycles, wear=cycles / end), name)
    return terminal


def test_status_ends_as_monitoring_plugins_do(day: Terminal) -> None:
    states = (
        ("fine", 0, "Normal"),
        ("c1", 1, "Function check"),
        ("worn", 2, "Failure"),
        ("nobody", 3, "register nobody"),
    )
    for clutch, code, words in states:
        assert words in day("status", clutch, code=code)
    assert day("watch", "fine", "--looks", "3", "--every", "0.1").count("fine: Normal") == 1


def test_a_wrong_call_is_one_plain_line_and_status_then_unknown() -> None:
    away = f"http://127.0.0.1:{free_port()}"
    assert "unknown" in clutchlife("status", "fine", "--url", away, "--patience", "0", code=3)
    for wrong in (("status",), ("status", "fine", "--bogus"), ("status", "fine", "--url", "nonsense")):
        assert len(clutchlife(*wrong, code=3).strip().splitlines()) == 1, wrong
    for wrong in (("life",), ("bogus",), ("key", "create"), ("list", "--bogus")):
        (line,) = clutchlife(*wrong, code=64).strip().splitlines()
        assert "--help" in line
    assert clutchlife("--version").strip() == f"clutchlife {version('clutchlife')}"


def test_clutches_are_registered_and_listed(day: Terminal, client: TestClient, tmp_path: Path) -> None:
    record = tmp_path / "record.json"
    record.write_text(json.dumps({"fluid": "other"}), encoding="utf-8")
    assert "is registered" in day("register", "new", "--record", record, "--set", "geometry.friction_faces=4")
    made, listed = client.get("/v1/clutches/new").json(), client.get("/v1/clutches").json()["items"]
    assert (made["fluid"], made["geometry"]["friction_faces"]) == ("other", 4)
    assert json.loads(day("list", "--json")) == listed
    assert "failure" in day("list")
    assert "409" in day("register", "new", code=65)


def test_alarms_are_listed_and_acknowledged(day: Terminal, client: TestClient) -> None:
    assert "no alarm" in day("alarms", "--clutch", "worn")
    client.post("/v1/alarms", json={"clutch_id": "worn", "quantity": "state"})
    (event,) = json.loads(day("alarms", "--json"))
    assert "worn: failure" in day("alarms")
    assert "acknowledged" in day("alarms", "--acknowledge", event["event_id"], "--note", "seen")
    assert "state" in day("alarms", "--rules")


def test_a_push_to_a_mistyped_clutch_leaves_nothing_in_the_spool(terminal: Terminal, tmp_path: Path) -> None:
    run, spool = tmp_path / "run.json", tmp_path / "spool"
    run.write_text(json.dumps(stationary(4000.0)), encoding="utf-8")
    (tmp_path / "clutch.json").write_text(json.dumps({"clutch_id": "fine"}), encoding="utf-8")
    for pushed in (run, tmp_path):
        assert "clutchlife register fien" in terminal("push", pushed, "--clutch", "fien", "--spool", spool, code=65)
    assert not list(spool.rglob("*.body"))


def test_a_list_states_cycles_whole_and_no_remaining_life_after_an_end() -> None:
    left = {"at_least": 2.9, "status": "predicted", "ended": None, "remaining_cycles": {"0.5": 4.2}}
    summary = {"as_of_cycles": 1e7} | left
    item = {"clutch_id": "c", "held": 0, "summary": summary, "state": {"name": "normal"}}
    assert _row(item) == ["c", "normal", "10,000,000", "2", "4", ""]
    over = {"at_least": None, "status": "ended", "ended": {"cycles": 1e7}, "remaining_cycles": {"0.5": None}}
    assert _row(item | {"summary": summary | over}) == ["c", "ended, normal", "10,000,000", "-", "-", ""]
    assert _row(item | {"summary": summary | over | {"ended": None}})[1] == "normal"


def test_no_note_or_name_commands_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """The title of a window, colours, a line written over: by a line, a table, an error."""
    evil = "a\x1b]0;b\x07\x1b[2Jc\x9bd\u202e"
    table = Table("note")
    table.add_row(evil)
    print_line(evil)
    out.print(table)
    with pytest.raises(typer.Exit):
        fail(evil)
    printed = "".join(capsys.readouterr())
    assert printed.count("a\ufffd]0;b") == 3
    assert all(sign.isprintable() or sign == "\n" for sign in printed)
