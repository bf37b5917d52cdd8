"""Criteria in words, and the remaining life that the charts of mean COF show whatever else ends a life."""

from collections.abc import Callable
from typing import Any, get_args

import pytest

from service.schemas.life import QuantityName
from tests.browser.modules import Module

pytestmark = pytest.mark.browser

NONE = {"0.05": None, "0.5": None, "0.95": None}
PLACE = {"fraction": None, "below": None, "above": None, "pressure_bar": None, "speed_rpm": None, "frequency_hz": None}
SLOPE = PLACE | {"quantity": "slope", "below": 0.0, "pressure_bar": 5.0, "speed_rpm": 100.0}
MEAN_COF = PLACE | {"quantity": "mean_cof", "fraction": 0.5}
STOP = PLACE | {"quantity": "stop_time_s", "above": 1.2}
FILM = PLACE | {"quantity": "film_time", "above": 0.02, "pressure_bar": 4.0, "frequency_hz": 0.1}


@pytest.fixture(scope="module")
def criteria(loaded: Callable[[str], Module]) -> Module:
    return loaded("quantities/criteria.js")


def outcome(criterion: dict[str, Any], end: tuple[Any, Any, Any], now: float, **more: Any) -> dict[str, Any]:
    ends = dict(zip(NONE, end, strict=True))
    left = {level: None if at is None else max(0.0, at - now) for level, at in ends.items()}
    known = {"current": {"value": 0.1, "sd": 0.01}, "probability_of_reaching": 0.9, "probability_first": 0.5}
    return criterion | {"limit": 0.0, "end_of_life_cycles": ends, "remaining_cycles": left} | known | more


@pytest.mark.parametrize(
    ("criterion", "place", "limit"),
    [
        (SLOPE, "Slope dμ/dv, 100 rpm, 5.0 bar", "below 0 s/m"),
        (MEAN_COF, "Mean COF", "50 % of new"),
        (STOP, "Stop time", "above 1.20 s"),
        (FILM, "Film time, 0.10 Hz, 4.0 bar", "above 0.0200 s"),
    ],
)
def test_a_criterion_names_its_quantity_its_place_and_its_limit(
    criteria: Module, criterion: dict[str, Any], place: str, limit: str
) -> None:
    assert criteria("placeText", criterion) == place
    assert criteria("limitText", criterion) == limit


@pytest.mark.parametrize(
    ("end", "more", "text"),
    [
        (
            (8000, 9000, 10_000), {},
            "the limit 0 is reached at about 9,000 cycles (90 %: 8,000 to 10,000), 4,000 cycles from now",
        ),
        ((2000, 3000, 4000), {}, "the limit 0 has been reached at about 3,000 cycles (90 %: 2,000 to 4,000)"),
        (
            (9000, None, None), {"probability_of_reaching": 0.3},
            "the limit 0 may never be reached: it is reached with a probability of 30 %",
        ),
        ((None, None, None), {"probability_of_reaching": None}, "too few tests to predict when it is reached"),
    ],
)  # fmt: skip
def test_when_a_limit_is_reached_is_said_in_words(
    criteria: Module, end: tuple[Any, Any, Any], more: dict[str, Any], text: str
) -> None:
    assert criteria("reachedText", outcome(SLOPE, end, 5000, **more)) == text


def life(*ends: dict[str, Any]) -> dict[str, Any]:
    first = ends[0]
    return {
        "status": "predicted",
        "criterion": first | {"threshold_mean_cof": None},
        "criteria": list(ends),
        "end_of_life_cycles": first["end_of_life_cycles"],
        "remaining_cycles": first["remaining_cycles"],
    }


def test_charts_of_mean_cof_show_its_own_end_where_another_criterion_is_the_first(criteria: Module) -> None:
    slope = outcome(SLOPE, (5500, 6000, 6500), 5000)
    cof = outcome(MEAN_COF, (8000, 9000, 10_000), 5000, limit=0.07)
    answer = criteria("byMeanCof", life(slope, cof))
    assert answer["end_of_life_cycles"] == cof["end_of_life_cycles"]
    assert (answer["criterion"]["threshold_mean_cof"], answer["criterion"]["fraction"]) == (0.07, 0.5)
    assert answer["status"] == "predicted"
    passed = life(outcome(SLOPE, (1000, 2000, 3000), 5000), cof) | {"status": "reached"}
    assert criteria("byMeanCof", passed)["status"] == "predicted"  # its slope has ended it, not its mean COF
    without = criteria("byMeanCof", life(slope))
    assert without["end_of_life_cycles"] == NONE
    assert without["criterion"]["threshold_mean_cof"] is None


def test_what_limits_first_is_always_said(criteria: Module) -> None:
    slope, cof = outcome(SLOPE, (5500, 6000, 6500), 5000), outcome(MEAN_COF, (8000, 9000, 10_000), 5000)
    for ends in ((cof,), (slope,), (cof, slope)):
        assert len(criteria("criteriaTable", life(*ends))) == 1


@pytest.mark.parametrize("quantity", get_args(QuantityName))
def test_every_quantity_that_may_end_a_life_has_a_title(criteria: Module, quantity: str) -> None:
    given = outcome(PLACE | {"quantity": quantity, "above": 1.0}, (5500, 6000, 6500), 5000)
    assert criteria("placeText", given) not in ("", quantity)
    assert criteria("criterionRow", given)[3] == "6,000"
