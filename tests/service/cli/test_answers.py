"""What an engineer reads in a terminal about a clutch: tables of the service's own answers, which is in this process."""

import csv
import io
import json
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.cli import answers
from tests.service.cli.conftest import Terminal
from tests.support import stationary

DUTY = {"kind": "duty_cycles", "cycles": 3000, "duty": {"cycles": 3000, "energy_per_cycle_kj": 18}}
LIFE = "/v1/clutches/c1/remaining-useful-life"


@pytest.fixture(autouse=True)
def aged(client: TestClient) -> None:
    """The service has seen a clutch for 3,000 cycles."""
    tests = [stationary(cycles, pressures=(5.0, 6.0)) for cycles in (0, 1000, 2000, 3000)]
    for number, run in enumerate([*tests, DUTY]):
        assert client.post("/v1/clutches/c1/runs", json=run | {"run_id": f"r{number}"}).status_code == 201


def test_remaining_life_is_a_table_of_quantiles(terminal: Terminal, client: TestClient) -> None:
    shown, answer = terminal("life", "c1"), client.get(LIFE).json()
    assert "c1 at 3,000 cycles: " in shown
    assert "4 tests, method particle, model baseline" in shown
    row = next(line for line in shown.splitlines() if line.startswith("remaining cycles"))
    median = answer["remaining_cycles"]["0.5"]
    assert ("over 1,000,000" if median is None else f"{median:,.0f}") in row
    assert json.loads(terminal("life", "c1", "--json")) == answer
    assert "method grid" in terminal("life", "c1", "--method", "grid", "--pressure", "5")
    assert "calibrated" not in shown
    calibrated = [(count, list(answers._lines(answer | {"ended_lives": count}))) for count in (1, 2)]
    assert all(f"calibrated on {count} ended" in "\n".join(lines) for count, lines in calibrated)
    rows = list(csv.DictReader(io.StringIO(terminal("life", "c1", "--csv", "--at-cycles", "2000"))))
    assert {row["as_of_cycles"] for row in rows} == {"2000"}


def test_planned_duty_by_block_and_by_file_is_the_same(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    by_energy = {"severity": {"basis": "dissipated_energy"}, "reason": "its duty varies"}
    changed = client.patch("/v1/clutches/c1", json=by_energy)
    assert changed.status_code == 200, changed.text
    (tmp_path / "plan.json").write_text('{"programme": [{"cycles": 5000, "energy_per_cycle_kj": 36, "sd": 2}]}')
    shown = terminal("life", "c1", "--block", "5000:36:2", "--pace", "120")
    assert shown == terminal("life", "c1", "--plan", tmp_path / "plan.json", "--pace", "120")
    for words in ("remaining blocks", "under recent duty", "date, counted from 2", "120 cycles an hour, as planned"):
        assert words in shown, words
    answer = json.loads(terminal("life", "c1", "--block", "5000:36:2", "--json"))
    # twice the energy of the blocks so far: half the cycles, by the middle of the distribution
    assert answer["block_severity"][0] == pytest.approx(2.0, rel=0.02)
    assert answer["pace_cycles_per_hour"] is None
    bound = answer["at_least"]
    for pace, days in ((120.0, "less than a day"), (bound / 35, "1 day"), (bound / 61, "2 days")):
        shown = terminal("life", "c1", "--block", "5000:36:2", "--pace", pace)
        assert f"safe for {days} at the planned pace, counted from the last run on 2" in shown
    assert "counted from" not in terminal("life", "c1", "--block", "5000:36:2")


def test_the_tables_hold_every_item_of_the_answer_on_a_line(terminal: Terminal, client: TestClient) -> None:
    lines = terminal("degradation", "c1").splitlines()
    items = client.get("/v1/clutches/c1/degradation").json()["items"]
    assert [line.split()[0] for line in lines[1 : 1 + len(items)]] == [item["quantity"] for item in items]
    assert next(csv.reader(io.StringIO(terminal("degradation", "c1", "--csv"))))[0] == "quantity"
    assert "c1 has no loops" in terminal("loops", "c1")
    course = terminal("engagement", "c1", "--at-cycles", "1000")
    assert "c1 at 1,000 cycles, simulated: " in course
    assert "motor_torque_nm" in course
    assert json.loads(terminal("engagement", "c1", "--json")) == client.get("/v1/clutches/c1/engagement").json()


def test_an_end_by_other_criteria_shows_how_probably_each_is_first(terminal: Terminal, client: TestClient) -> None:
    slope = {"quantity": "slope", "pressure_bar": 5, "speed_rpm": 100}
    changed = {"end_of_life": {"criteria": [{"quantity": "mean_cof"}, slope]}, "reason": "it shudders"}
    assert client.patch("/v1/clutches/c1", json=changed).status_code == 200
    lines = terminal("life", "c1").splitlines()
    heading = next(place for place, line in enumerate(lines) if line.startswith("criterion"))
    rows = [line.split() for line in lines[heading + 1 : heading + 3]]
    assert [row[0] for row in rows] == ["mean_cof", "slope"]
    assert rows[1][1:3] == ["5", "100"]
    reached = client.get(LIFE).json()["probability_of_reaching"]  # one of them is the first where any is reached
    assert sum(float(row[-2]) for row in rows) == pytest.approx(100.0 * reached, abs=1.1)
    alone = terminal("life", "c1", "--quantity", "slope", "--pressure", "5")
    assert "slope" in alone
    assert "course" not in alone  # the course and the forecasts that were held are those of mean COF
    answer = json.loads(terminal("life", "c1", "--quantity", "slope", "--pressure", "5", "--life", "1", "--json"))
    assert (answer["course"], answer["back_cast"], answer["life"]["number"]) == (None, None, 1)


def test_what_cannot_be_answered_is_refused_in_a_line(terminal: Terminal) -> None:
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
        assert words in terminal(*arguments, code=code), arguments
