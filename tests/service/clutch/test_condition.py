"""What a list, a page and a terminal say of a clutch: its state with the reason, its safe bound, its held runs."""

import itertools
from collections.abc import Iterator, Mapping
from itertools import permutations
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.diagnosis.experiments.candidates import TRIALS
from models.prognosis.course_shares import CourseName, CourseProbability
from models.prognosis.criteria import QUANTILES
from service.answers import clutch_list, degradation, series
from service.answers import remaining_life as answer_of_life
from service.answers.remaining_life import remaining_life
from service.api.clutch import AdvisedTest, LatestDiagnosis
from service.api.life import LifePrediction
from service.clutch.assumptions import ALL_PRESSURES, Assumptions
from service.clutch.condition import (
    STATE_WORDS,
    bound_in_words,
    lower_bound,
    rank_of,
    recent,
    state_of,
    statement_of,
    top_line,
    with_held_runs,
)
from service.clutch.criteria import MAX_LINE_POINTS
from service.clutch.items import insufficient
from service.clutch.notices import approximate, filters_disagree
from service.clutch.timeline import Event
from service.errors import Notice
from service.paging import WHOLE
from tests.service.changes.benches import CLUTCH, Bench, body, stood_in
from tests.service.clients import as_answered
from tests.support import one_quick, stationary

#: The present, as the answers state it.
PRESENT = ("mean_cof", "mean_cof_sd", "measured_at_cycles", "fraction_of_initial", "health")
METHODS = ("particle", "ukf", "grid")


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    with stood_in(monkeypatch):
        made = Bench(tmp_path / "a.db")
        yield made
        made.close()


def now(bench: Bench, method: str = "particle", pressure: float | None = None) -> dict[str, Any]:
    return as_answered(remaining_life(bench.database, CLUTCH, method, pressure, None))


def item(bench: Bench) -> dict[str, Any]:
    return as_answered(clutch_list.look_up(bench.database, CLUTCH))


def test_after_one_test_and_a_block_of_duty_health_is_unknown_and_mean_cof_is_the_measured_one(bench: Bench) -> None:
    fit = bench.send(body("test", "a", 100.0))["fits"]
    bench.send(body("duty", "d", 5000.0))
    measured = sum(level["mean_cof"] for level in fit) / len(fit)
    for answer in (*(now(bench, method) for method in METHODS), item(bench)["summary"]):
        assert answer["status"] == "insufficient_data"
        assert answer["as_of_cycles"] == 5000
        current = answer["current"]
        assert current["mean_cof"] == pytest.approx(measured)
        assert 0.0 < current["mean_cof_sd"] < 0.05 * measured
        assert [current[name] for name in PRESENT[2:]] == [100, None, None]
        assert set(answer["remaining_cycles"].values()) == {None}
    for tracked in as_answered(degradation.degradation(bench.database, CLUTCH))["items"]:
        assert tracked["measured"]["cycles"] == [100]
        assert (tracked["coefficients"], tracked["trajectory"]["cycles"]) == (None, [])
    rows = as_answered(series.series(bench.database, CLUTCH, WHOLE, None))["items"]
    stated = {row["quantity"]: row["value"] for row in rows if not row["run_id"]}
    assert stated == dict.fromkeys(stated) | {"at_least": 0.0}
    assert item(bench)["state"]["name"] == "check"


def test_two_tests_say_at_least_how_many_cycles_are_left(bench: Bench) -> None:
    for cycles in (0.0, 2000.0):
        bench.send(body("test", f"n{cycles:g}", cycles, wear=cycles / 28_000))
    life = now(bench)
    assert life["at_least"] > 100.0
    assert life["statement"] == f"the remaining life is not known yet: {bound_in_words(life['at_least'])}"
    assert item(bench)["summary"]["statement"] == life["statement"]


@pytest.mark.parametrize(
    ("at_least", "words"),
    [(None, "no further cycle is safe"), (0.99, "no further cycle is safe"),
     (1.9, "safe for fewer than 10 more cycles (95 %)"),
     (9.9, "safe for fewer than 10 more cycles (95 %)"), (99.9, "safe for 99 more cycles (95 %)"),
     (10.0, "safe for 10 more cycles (95 %)"),
     (100.0, "safe for 100 more cycles (95 %)"), (1099.0, "safe for 1,000 more cycles (95 %)"),
     (12_999.0, "safe for 12,000 more cycles (95 %)")],
)  # fmt: skip
def test_a_safe_bound_is_never_said_to_be_more_than_it_is(at_least: float | None, words: str) -> None:
    assert bound_in_words(at_least) == words


def test_a_life_of_millions_of_cycles_is_predicted_beyond_a_million(bench: Bench) -> None:
    for cycles in np.arange(7) * 1e6:
        bench.send(body("test", f"n{cycles:g}", float(cycles), wear=cycles / 2e7))
    for answer in (now(bench, method) for method in METHODS):
        assert answer["horizon_cycles"] == 6e7
        assert 2e6 < answer["remaining_cycles"]["0.5"] < 8e6  # half of its friction is gone at 10 million
        assert 0.0 < answer["at_least"] == answer["remaining_cycles"]["0.05"]
    assert rank_of(item(bench)["summary"]) == min(now(bench)["at_least"], 1e6)  # before those that are not known
    bench.send(body("duty", "d", 9e6))
    assert now(bench)["horizon_cycles"] == 9e7


def test_tests_at_the_same_cycles_or_at_other_pressures_are_not_asked_for_again(bench: Bench) -> None:
    for place, pressures in enumerate([(4.0, 5.0), (4.0, 5.0), (4.0, 5.0), (4.0, 5.0), (2.0,)]):
        bench.send(stationary(500.0 * (place == 4), run_id=f"n{place}", wear=0.01 * place, pressures=pressures))
    shown = item(bench)
    why = "tests at 1 of the 3 different cycles that a prediction needs (1 more cannot"
    assert shown["state"]["why"].startswith(why)
    assert shown["action"].startswith("Run 2 more stationary tests, at different cycles, with the pressures and oil")
    for answer in (now(bench, method) for method in METHODS):
        (warning,) = answer["warnings"]
        assert (warning["code"], answer["runs_used"]) == ("tests_left_out", 4)
        assert warning["message"].startswith("1 of 5 tests does not count")


@pytest.mark.parametrize("every", one_quick([60, 24]))
def test_what_is_said_of_held_runs_does_not_depend_on_the_order_of_arrival(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, every: int
) -> None:
    tests = [body("test", f"n{cycles:g}", cycles, wear=cycles / 40_000) for cycles in (0.0, 2000.0, 4000.0)]
    held = [body("test", "h1", 1000.0, wear=0.1, odd=True), body("test", "h2", 5000.0, wear=0.5, odd=True)]
    sent = [*tests, *held]
    said = []
    with stood_in(monkeypatch):
        for number, order in enumerate(list(permutations(range(5)))[::every]):
            bench = Bench(tmp_path / f"{number}.db")
            for index in order:
                bench.send(sent[index])
            said.append({name: now(bench)[name] for name in ("at_least", "held_runs", "remaining_cycles")})
            said[-1]["state"] = item(bench)["state"]
            bench.close()
    assert said.count(said[0]) == len(said) == 120 / every


def summary(left: float | None, **other: Any) -> dict[str, Any]:
    """A clutch 10,000 cycles old with so many left at every quantile."""
    quantiles = {f"{level:g}": left for level in QUANTILES}
    limit = {"quantity": "slope", "speed_rpm": 100, "pressure_bar": 5, "fraction": None, "below": 0.0, "above": None}
    return {
        "status": "predicted", "as_of_cycles": 10_000, "from_cycles": 0, "runs_used": 9, "at_least": left,
        "remaining_cycles": quantiles, "current": {"health": 0.5, "measured_at_cycles": 9_000},
        "end_of_life_cycles": dict.fromkeys(quantiles, None if left is None else 9000 + left),
        "criterion": limit, "held": 0, "with_held": None,
        "probability_of_reaching": 0.94, **other,
    }  # fmt: skip


def test_page_and_answer_say_the_same_of_held_runs_before_a_prediction() -> None:
    nothing = {"status": "insufficient_data", "remaining_cycles": summary(None)["remaining_cycles"]}
    among = nothing | {"at_least": 0.0}
    known = summary(1800.0, held=1, with_held={"particle": among}, ended=None, **nothing | {"runs_used": 2})
    warning = with_held_runs(known, known, among, 1).warning
    assert warning is not None
    assert warning.message.endswith("with it the remaining life is not known: no further cycle is safe")
    assert "no further cycle is safe if the held run counts" in top_line(known, disputed=False)["headline"]


PACE = {"cycles_per_second": 1000 / 86_400, "moment": 1_796_083_200.0}  # 1,000 cycles a day from 1 December 2026
HELD = {"held": 1, "with_held": {"particle": {"status": "predicted", "at_least": 3149.0, "remaining_cycles": {}}}}


def found(causes: list[str], advice: list[str] | None = None, *, adoptable: bool = False) -> LatestDiagnosis:
    """A diagnosis as it goes out."""
    verdict = {0: "unexplained_structure", 1: "cause_named"}.get(len(causes), "cause_ambiguous")
    advised = advice and {"test": "stationary test with the oil at 60 °C", "separates": advice}
    of_row = {"diagnosis_id": "d", "adopted": False, "earlier_life": False}
    return LatestDiagnosis(verdict=verdict, causes=causes, advice=advised, adoptable=adoptable, **of_row)


def advising(test: str, effect: str) -> LatestDiagnosis:
    return found([effect]).model_copy(update={"advice": AdvisedTest(test=test, separates=[effect])})


@pytest.mark.parametrize(
    ("known", "diagnosis", "headline", "action"),
    [
        (
            summary(9450.0, pace=PACE), None,
            "Normal: safe for 9,400 more cycles (95 %): 9 days at the pace so far, counted from the last run on "
            "1 Dec 2026; 50 % chance of 9,400 or more",
            "Nothing to do: carry on testing.",
        ),
        (
            summary(9450.0, corrected=["Corrected: the clutch gets 0.38 bar less than the gauge reads. Repair the gauge."]),
            None,
            "Normal: safe for 9,400 more cycles (95 %); 50 % chance of 9,400 or more",
            "Corrected: the clutch gets 0.38 bar less than the gauge reads. Repair the gauge.",
        ),
        (
            summary(2000.0, pace=PACE), None,
            "Maintenance required: less than 20 % of its life may be left; safe for 2,000 more cycles (95 %): "
            "2 days at the pace so far, counted from the last run on 1 Dec 2026; 50 % chance of 2,000 or more",
            "Replace within 2 days at the pace so far, counted from the last run on 1 Dec 2026.",
        ),
        (summary(2000.0, held=2), None, "Maintenance required: less than 20 % of its life may be left", "Replace soon."),
        (
            summary(9000.0, current={"health": 0.05}), None,
            "Maintenance required: near its limit, slope, 100 rpm, 5 bar below 0", "Replace soon.",
        ),
        (
            summary(9000.0, current={"health": 0.12}), None,
            "Normal: safe for 9,000", "Have a replacement at hand: health 12 %.",
        ),
        (summary(900.0, pace=PACE), None, "Maintenance required: ", "Replace within less than a day at the pace so far"),
        (summary(0.4, pace=PACE), None, "Maintenance required: ", "Replace now."),
        (
            summary(900.0, rig_question="mean COF stepped at 7,000 cycles"), None, "Maintenance required: ",
            "Check the measurement before you replace anything: mean COF stepped at 7,000 cycles, which a rig may do too; "
            "run the diagnosis.",
        ),
        (
            summary(0.0, status="reached", rig_question="mean COF at 2 bar has risen"), found(["drag"]), "Failure: ",
            "Check the measurement before you replace anything: mean COF at 2 bar has risen, which a rig may do too; see",
        ),
        (
            summary(0.0, status="reached", rig_question="mean COF stepped", oil_question="it went from 40 to 80 °C"), None,
            "Failure: ", "Bring the oil to one temperature, within 10 °C, and repeat the test: it went from 40 to 80 °C.",
        ),
        (
            summary(9000.0, rig_question="mean COF stepped at 7,000 cycles and no maintenance was sent"), None,
            "Normal: ", "Nothing to do: carry on testing.",
        ),
        (
            summary(9450.0, status="may_never_reach", pace=PACE), None,
            "Normal: safe for 9,400 more cycles (95 %): 9 days at the pace so far, counted from the last run on "
            "1 Dec 2026; later tests will tell",
            "Nothing to do: carry on testing.",
        ),
        (
            summary(0.0, status="reached"), None,
            "Failure: the end of life is reached: its limit is slope, 100 rpm, 5 bar below 0",
            "Replace the clutch.",
        ),
        (
            summary(0.0, status="reached", end_of_life_cycles={"0.5": 9_700.0}), None,
            "Failure: the end of life is probably reached since the last test at 9,000 cycles: its limit is slope",
            "Run a stationary test, or replace the clutch.",
        ),
        (
            summary(9000.0, **HELD), None,
            "Function check: 1 run is held and does not count; safe for 3,100 more cycles (95 %) if the held run "
            "counts, for 9,000 if not",
            "Confirm, correct or withdraw one held run.",
        ),
        (
            summary(9000.0, held=2, with_held={"particle": HELD["with_held"]["particle"] | {"at_least": 0.0}}), None,
            "Function check: 2 runs are held and do not count; no further cycle is safe if the held runs "
            "count; safe for 9,000 more cycles (95 %) if not",
            "Confirm, correct or withdraw 2 held runs.",
        ),
        (
            summary(800.0, status="insufficient_data", runs_used=2), None,
            "Function check: 2 of the 3 tests that a prediction needs; the remaining life is not known yet: safe for",
            "Run one more stationary test: then the remaining life is predicted.",
        ),
        (
            summary(800.0, status="insufficient_data", runs_used=6, tests=6, places=2), None,
            "Function check: tests at 2 of the 3 different cycles that a prediction needs; the remaining life is not",
            "Run one more stationary test: then the remaining life is predicted.",
        ),
        (
            summary(0.0, status="insufficient_data", runs_used=1, tests=7, places=1), None,
            "Function check: 1 of the 3 tests that a prediction needs (6 more cannot be compared with the first); ",
            "Run 2 more stationary tests, at different cycles, with the pressures and oil of this life's first test: then",
        ),
        (
            {name: value for name, value in summary(0.0, status="reached").items() if name != "end_of_life_cycles"}, None,
            "Failure: the end of life is reached", "",  # as it was stored without the end
        ),
        ({}, None, "Function check: no run counts yet", "Run 3 more stationary tests, at different cycles: then "),
        (
            summary(9000.0), found(["oil_temperature"], adoptable=True),
            "Out of specification: data and model disagree", "Adopt the model with oil",
        ),
        (
            summary(9000.0), found(["inertia_torque", "drag"], ["inertia_torque", "drag"], adoptable=True),
            "Out of specification: ",
            "The cause is not clear yet. Run a stationary test with the oil at 60 °C: it decides between inertia torque ",
        ),
        (
            summary(9000.0), found(["oil_temperature"], ["oil_temperature", "baseline"]), "Out of specification: ",
            "Run a stationary test with the oil at 60 °C: it shows whether oil temperature is at work.",
        ),
        (
            summary(9000.0),
            advising(f"stationary test at 5 bar, and {80 * 'x'}", "film"),
            "Out of specification: ", "Run the advised tests, first a stationary test at 5 bar: it shows whether film",
        ),
        (
            summary(9000.0),
            advising(TRIALS["rests"].text, "rest_recovery"),
            "Out of specification: ", "Run three more stationary tests, each after the usual cycles; rest two days before "
            "the first and third: it shows whether rest recovery is at work.",
        ),
        (summary(9000.0), found([]), "Out of specification: ", "Read the diagnosis before you rely on the forecast."),
    ],
    ids=str,
)  # fmt: skip
def test_the_top_line_answers_and_says_what_to_do(
    known: dict[str, Any], diagnosis: LatestDiagnosis | None, headline: str, action: str
) -> None:
    line = top_line(known, disputed=diagnosis is not None, diagnosis=diagnosis)
    assert line["headline"].startswith(headline)
    assert line["action"].startswith(action)
    state = state_of(known, disputed=diagnosis is not None)
    assert headline.startswith(f"{STATE_WORDS[state['name']]}: ")
    assert state["name"] == "normal" or "safe for" not in state["why"]  # which the remaining cycles say
    assert "may never" not in state["why"]
    assert ("probability of 94 %" in state["why"]) is (known.get("status") == "may_never_reach")


def test_a_clutch_that_shudders_is_no_longer_normal(tmp_path: Path) -> None:
    """Its record ends the life where the slope rises above a value that it has long passed; mean COF has hardly changed."""
    criteria = [{"quantity": "mean_cof"}, {"quantity": "slope", "speed_rpm": 100, "pressure_bar": 4.0, "above": -1e-9}]
    states = []
    for number, record in enumerate(({}, {"end_of_life": {"criteria": criteria}})):
        bench = Bench(tmp_path / f"{number}.db", record)
        for cycles in (0.0, 500.0, 1000.0, 1500.0):
            bench.send(body("test", f"n{cycles:g}", cycles, wear=cycles / 8_000))
        states.append(item(bench)["state"])
        bench.close()
    assert states[0]["name"] == "normal"
    assert states[1]["name"] in ("failure", "maintenance")


def test_a_trajectory_goes_on_as_far_as_is_asked(bench: Bench) -> None:
    for cycles in (0.0, 1000.0, 2000.0):
        bench.send(body("test", f"t{cycles:g}", cycles))
    for until, last in ((None, 3000.0), (20_000.0, 20_000.0)):
        track = degradation.degradation(bench.database, CLUTCH, "ukf", "static_torque_nm", until=until).items[0]
        assert track.trajectory.cycles[-1] == pytest.approx(last)
        assert len(track.trajectory.median) == len(track.trajectory.cycles)


def test_lists_sort_by_the_bound_that_they_show_first_and_statements_say_that_held_runs_lower_it() -> None:
    """Sorted by the median, a clutch with 300 certain cycles stood below one with 4,000."""
    sure, unsure = (
        {"status": "predicted", "at_least": low, "remaining_cycles": {"0.5": median}, "with_held": held}
        for low, median, held in ((4000.0, 5000.0, None), (4500.0, 9000.0, {"particle": {"at_least": 300.0}}))
    )
    assert rank_of(unsure) == 300.0 < rank_of(sure) == 4000.0
    for among, words in (
        (0.0, "no further cycle is safe, if held runs count"),
        (9500.0, "safe for 9,000 more cycles (95 %)"),
    ):
        assert statement_of(summary(9000.0), lower_bound(9000.0, {"at_least": among})) == words


def predicted(status: str, remaining: dict[str, float | None]) -> LifePrediction:
    nothing = insufficient(Assumptions(), 0.0, ALL_PRESSURES, 0.5)
    return nothing.model_copy(update={"status": status, "remaining_cycles": remaining})


@pytest.mark.parametrize(
    ("other", "warns"),
    [((5000, 9000, 30000), False), ((9000, 20000, None), True), ((4000, None, None), True), ((1, 4999, 20000), True)],
)
def test_a_median_outside_the_interval_of_another_filter_warns(other: tuple[float | None, ...], warns: bool) -> None:
    answers = {
        method: predicted("predicted", dict(zip(("0.05", "0.5", "0.95"), ends, strict=True)))
        for method, ends in (("particle", (5000, 8000, 12000)), ("ukf", other))
    }
    notices = filters_disagree(answers | {"grid": predicted("insufficient_data", {})})
    assert [notice.code for notice in notices] == ["filters_disagree"] * warns
    assert all("8,000 (90 %: 5,000 to 12,000) by particle" in notice.message for notice in notices)


def test_the_exact_filter_is_compared_with_those_that_are_carried(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    for cycles in (0.0, 1000.0, 2000.0):
        bench.send(body("test", f"t{cycles:g}", cycles))
    compared: list[set[str]] = []

    def record(answers: Mapping[str, LifePrediction]) -> list[Notice]:
        compared.append(set(answers))
        return []

    monkeypatch.setattr(answer_of_life, "filters_disagree", record)
    for method in METHODS:
        remaining_life(bench.database, CLUTCH, method, None, None)
    assert compared == [{"particle", "ukf"}, {"particle", "ukf"}, set(METHODS)]


def test_the_unscented_filter_is_called_approximate_where_its_course_is_not_eq_6() -> None:
    shares = {
        name: CourseProbability(name=name, probability=probability, order=1.0)
        for name, probability in ((CourseName.EQ_6, 0.4), (CourseName.SLOWING, 0.6))
    }
    slowing_first, eq_6_first = [shares[CourseName.SLOWING], shares[CourseName.EQ_6]], list(shares.values())
    (notice,) = approximate("ukf", slowing_first)
    assert notice.code == "approximate"
    assert "slowing, 60 %" in notice.message.replace("60%", "60 %")
    assert approximate("ukf", eq_6_first) == approximate("particle", slowing_first) == []


# --- What a list shows of a clutch's latest past: the last run, mean COF as a short line, the newest verdict.


@pytest.mark.parametrize("count", [0, 1, MAX_LINE_POINTS, MAX_LINE_POINTS + 1, 1000])
def test_a_line_is_short_and_ends_with_the_last_value(count: int) -> None:
    series = SimpleNamespace(measurements=[SimpleNamespace(value=float(index)) for index in range(count)])
    events = [Event(run_id=f"{at:g}", kind="maintenance", cycles=100.0 - at, moment=at) for at in (5.0, 10.0, 0.0)]
    both = recent(events, series)  # type: ignore[arg-type]
    last = {"run_id": "10", "kind": "maintenance", "cycles": 90, "at": "1970-01-01T00:00:10+00:00"}
    said = both.mean_cof
    assert as_answered(both.last_run) == last  # made last, whatever its cycles
    assert len(said) <= MAX_LINE_POINTS
    assert said[-1:] == [count - 1] * (count > 0)
    assert len({after - before for before, after in itertools.pairwise(said)}) <= 1


def test_a_list_is_made_anew_only_after_a_commit(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    page = clutch_list.page_as_json

    def counted(*arguments: Any, **named: Any) -> Any:
        made.append(1)
        return page(*arguments, **named)

    monkeypatch.setattr(clutch_list, "page_as_json", counted)
    first = client.get("/v1/clutches")
    assert first.json()["items"][0]["recent"] is None
    again = client.get("/v1/clutches", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, len(made)) == (304, 1)
    assert client.get("/v1/clutches?limit=1").json() == first.json()
    client.post("/v1/clutches/c1/runs", json=stationary(0))
    later = client.get("/v1/clutches", headers={"If-None-Match": first.headers["etag"]})
    (item,) = later.json()["items"]
    assert (later.status_code, item["runs"], len(made)) == (200, 1, 3)
    assert item == client.get("/v1/clutches/c1").json()
    measured = client.get("/v1/clutches/c1/degradation").json()["items"][0]["measured"]["value"]
    assert item["recent"]["mean_cof"] == pytest.approx(measured, abs=1e-6)
