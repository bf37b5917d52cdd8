"""What earlier forecasts said about the tests since: which are judged, and how much wider remaining life is for it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.prognosis.back_cast import BackCast, kept_after
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from tests.models.tracking.tracked_series import PRIOR

#: ξ is 1 for ever, with a deviation of 0.1 in the level of the draws.
LEVELS = 1.0 + 0.1 * np.linspace(-3.0, 3.0, 4_001)
WEIGHT = np.exp(-0.5 * np.square(np.linspace(-3.0, 3.0, 4_001)))
FLAT = Posterior(
    weight=WEIGHT / WEIGHT.sum(),
    initial=LEVELS,
    change=np.zeros(LEVELS.size),
    scale=np.ones(LEVELS.size),
    exponent=np.ones(LEVELS.size),
    scatter=np.zeros(LEVELS.size),
)


def measured(progress: float, value: float, *, variance: float = 0.0, epoch: int = 0) -> Measurement:
    return Measurement(progress=progress, value=value, variance=variance, epoch=epoch)


def forecast(posterior: Posterior = FLAT) -> BackCast:
    """One, made at 1,000 cycles."""
    return BackCast.nothing().forecast(posterior, measured(1_000.0, 1.0), PRIOR)


def test_a_miss_is_counted_in_half_widths_of_the_interval() -> None:
    judged = forecast().judged(measured(1_500.0, 1.0 + 0.1 * 1.645)).judged(measured(1_600.0, 1.0 - 0.2 * 1.645))
    np.testing.assert_allclose(judged.misses, [1.0, 2.0], rtol=0.02)
    assert replace(judged, misses=np.array([0.9, 1.0, 1.1])).held == 2


def test_a_test_that_is_far_off_counts_as_three_half_widths() -> None:
    assert forecast().judged(measured(1_500.0, 60.0)).misses.tolist() == [3.0]


def test_scatter_and_the_fits_variance_belong_to_the_interval() -> None:
    scattered = forecast(replace(FLAT, scatter=np.full(LEVELS.size, 0.1)))
    assert scattered.judged(measured(1_500.0, 1.2)).misses[0] == pytest.approx(
        0.2 / 1.645 / math.hypot(0.1, 0.1), rel=0.02
    )
    uncertain = forecast().judged(measured(1_500.0, 1.2, variance=0.01))
    assert uncertain.misses[0] == pytest.approx(0.2 / 1.645 / math.hypot(0.1, 0.1), rel=0.02)


@pytest.mark.parametrize(
    "untold",
    [measured(1_200.0, 1.0), measured(3_100.0, 1.0), measured(1_500.0, 1.0, epoch=1)],
    ids=["near", "far", "event"],
)
def test_what_no_forecast_was_made_for_is_not_judged(untold: Measurement) -> None:
    assert forecast().judged(untold).misses.size == 0


def test_forecasts_are_kept_ever_more_seldom() -> None:
    assert [tests for tests in range(100) if kept_after(tests)] == [3, 4, 6, 8, 12, 17, 24, 34, 48, 68, 96]


@pytest.mark.parametrize(
    ("misses", "power"),
    [([], 1.0), ([0.5], 1.0), ([0.5, 3.0], 3.0), ([0.1] * 8 + [5.0], 5.0), ([0.1] * 18 + [2.0, 5.0], 2.0)],
)
def test_the_power_is_the_conformal_quantile_of_the_misses(misses: list[float], power: float) -> None:
    assert replace(BackCast.nothing(), misses=np.array(misses)).widening == power


@pytest.mark.parametrize(
    ("held", "count", "surprising"), [(0, 1, False), (3, 4, False), (16, 20, False), (15, 20, True), (6, 10, True)]
)
def test_few_that_held_are_a_surprise(held: int, count: int, surprising: bool) -> None:
    misses = np.array([0.5] * held + [2.0] * (count - held))
    assert replace(BackCast.nothing(), misses=misses).surprising is surprising
