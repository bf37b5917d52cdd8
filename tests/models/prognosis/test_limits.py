"""Limits: where a path is at one, and which of several is the first."""

import math

import numpy as np
import pytest

from models.prognosis.limits import Limit, first_reached, places

PROGRESS = np.linspace(0.0, 100.0, 11)


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        (Limit(fraction=0.5), 50.0),
        (Limit(below=0.25), 75.0),
        (Limit(below=2.0), 0.0),
        (Limit(above=2.0), math.inf),
        (Limit(below=-1.0), math.inf),
    ],
)
def test_a_falling_line_is_at_its_limit_where_it_should_be(limit: Limit, expected: float) -> None:
    line = (1.0 - PROGRESS / 100.0)[:, None]
    assert limit.passages(line, PROGRESS)[0] == pytest.approx(expected)


def test_a_slope_that_changes_sign_and_a_quantity_that_rises() -> None:
    paths = np.stack([1.0 - 0.04 * PROGRESS, 1.0 + 0.0 * PROGRESS], axis=1)
    assert Limit(below=0.0).passages(paths, PROGRESS).tolist() == [pytest.approx(25.0), math.inf]
    assert Limit(above=1.5).passages(2.0 - paths, PROGRESS).tolist() == [pytest.approx(12.5), math.inf]


@pytest.mark.parametrize("wrong", [{}, {"fraction": 0.5, "below": 1.0}, {"fraction": 1.0}, {"above": math.nan}])
def test_what_is_no_limit_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"exactly one|fraction must lie"):
        Limit(**wrong)


def test_the_first_of_two_counts_and_says_which() -> None:
    """Two exponentials race: the faster wins with the share of its rate, and their minimum has the sum of the rates."""
    rng = np.random.default_rng(4)
    weight = np.full(40_000, 1.0 / 40_000)
    fast, slow = (rng.exponential(mean, 40_000) for mean in (1.0, 3.0))
    first, shares = first_reached([(fast, weight), (slow, weight)], 40_000, rng)
    assert shares == pytest.approx([0.75, 0.25], abs=0.01)
    assert first.mean() == pytest.approx(0.75, abs=0.015)


def test_what_is_never_reached_is_nobodys_first() -> None:
    weight = np.array([0.5, 0.5])
    ends = [(np.array([10.0, np.inf]), weight), (np.array([np.inf, np.inf]), weight)]
    first, shares = first_reached(ends, 1_000, np.random.default_rng(1))
    assert shares.tolist() == [pytest.approx(0.5), 0.0]
    assert np.isfinite(first).mean() == pytest.approx(0.5)


def test_places_go_from_the_beginning_to_the_horizon() -> None:
    at = places(5_000.0, 1e6)
    assert (at[0], at[-1]) == (0.0, pytest.approx(1e6))
    assert (np.diff(at) > 0.0).all()
    assert 5_000.0 in at
