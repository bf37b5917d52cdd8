"""Lives that are not one eq. 6, through the prior that the service takes from the first test.

Seeds are fixed and printed; `make score` gives the table for more lives.
"""

from typing import Any

import numpy as np
import pytest

from tests.lab.score.off_prior import rig_lives
from tests.statistical.forecasts import LAWS, STAGES, followed

pytestmark = pytest.mark.slow

LIVES = 30


def shares(told: Any) -> tuple[list[float], list[float]]:
    """Share of lives whose interval holds the truth, and whose interval begins after it, by stage: the filter alone."""
    found = np.array([[by_stage[stage] for stage in STAGES] for by_stage in told])
    return found[:, :, 0].mean(axis=0).tolist(), found[:, :, 1].mean(axis=0).tolist()


@pytest.mark.parametrize("name", [name for name in LAWS if name != "exponential to a floor"])
def test_from_60_percent_of_life_on_the_truth_is_held(name: str) -> None:
    """30 lives leave a deviation of 5 points at 90 %. Earlier, nothing in the data tells a line from the beginning of
    an eq. 6; the exponential, whose end lies near its floor, is the law that is held least: docs/appendix/prognosis.md."""
    course = LAWS[name]
    assert course(0.0) == pytest.approx(1.0)
    assert course(1.0) == pytest.approx(0.5, abs=2e-3)
    held, late = shares([followed(course, np.random.default_rng([900, life])) for life in range(LIVES)])
    print(f"seed 900, {name}: held {held}, begins after the truth {late}")
    assert min(held[2:]) > 0.75
    assert max(late[2:]) < 0.25


def test_the_rigs_own_lives_are_held_though_they_are_not_one_eq_6() -> None:
    """Mean COF of curves whose four parameters follow an eq. 6 each: 30 clutches leave a deviation of 5 points."""
    lives = rig_lives(LIVES, 901)
    assert len(lives) == LIVES
    told = [followed(course, np.random.default_rng([902, k]), end) for k, (course, end) in enumerate(lives)]
    held, late = shares(told)
    print(f"seeds 901 and 902: held {held}, begins after the truth {late}")
    assert min(held) > 0.8
    assert max(late) < 0.15
