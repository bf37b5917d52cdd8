"""Dates are judged in the order of cycles: those that contradict it, or that a rig cannot keep, are not believed."""

from collections.abc import Mapping

import pytest

from models.plausibility.dates import believed_dates

DAY = 86_400.0
COUNT = 10


def believed(changed: Mapping[int, float], days: float = 2.0) -> list[int]:
    """Of tests so many days and a thousand cycles apart, with other dates [days since the first] for some of them."""
    moments = [DAY * changed.get(k, days * k) for k in range(COUNT)]
    return believed_dates([1_000.0 * k for k in range(COUNT)], moments)


@pytest.mark.parametrize(
    ("changed", "not_believed"),
    [
        pytest.param({0: -56.0 * 365.0}, {0}, id="a first test of 1970"),
        pytest.param({9: 36.0 * 365.0, 8: 36.0 * 365.0 - 100.0}, set(), id="a rig that stood still"),
        pytest.param({0: 200.0}, {0}, id="a first test after all others"),
        pytest.param({9: -365.0}, {9}, id="a last test a year before"),
        pytest.param({4: 365.0}, {4}, id="one a year later than the next"),
        pytest.param({4: -365.0, 5: -363.0}, {4, 5}, id="two of the year before"),
        pytest.param({9: 16.02}, {9}, id="a thousand cycles in half an hour"),
        pytest.param({4: 9.98}, {4}, id="just before the next, although in order"),
        pytest.param({k: 12.0 + 0.4 * (k - 6) for k in (7, 8, 9)}, set(), id="five times as fast from some test on"),
        pytest.param({}, set(), id="as they are"),
    ],
)
def test_dates_that_do_not_fit_the_order_and_the_pace_of_cycles_are_not_believed(
    changed: Mapping[int, float], not_believed: set[int]
) -> None:
    assert set(range(COUNT)) - set(believed(changed)) == not_believed


def test_nothing_is_said_of_a_pace_that_too_few_dates_show() -> None:
    assert believed_dates([0.0, 1e3, 2e3], [0.0, 300.0 * DAY, 300.1 * DAY]) == [0, 1, 2]
    assert believed_dates([0.0], [5.0]) == [0]
    assert believed_dates([], []) == []


def test_runs_at_the_same_cycles_and_dates_are_in_order() -> None:
    """A test, maintenance and a block that begins there, of one day."""
    assert believed_dates([0.0, 1e3, 1e3, 1e3, 2e3], [0.0, DAY, DAY, DAY, 2.0 * DAY]) == [0, 1, 2, 3, 4]
    assert set(believed_dates([0.0, 1e3, 1e3], [0.0, 2.0 * DAY, DAY])) == {0, 1, 2}
