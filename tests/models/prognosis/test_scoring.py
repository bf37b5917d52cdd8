"""Scores of forecasts, and what a clutch's own earlier forecasts say of its next."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from models.prognosis.back_cast import BackCast, kept_after
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.scoring import (
    alpha_lambda,
    covered,
    crps_of_quantiles,
    pit_histogram,
    pit_of_quantiles,
    prognostic_horizon,
)
from models.prognosis.stated_end import stated_end
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from tests.models.prognosis.sample_scores import crps_of_sample, pit_of_sample
from tests.models.tracking.tracked_series import PRIOR, draws_of, on_grid, sent

# --- Scores against closed forms and hand-worked cases.

LEVELS = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)


def test_crps_takes_weights_as_repeated_draws() -> None:
    repeated = np.array([1.0, 1.0, 1.0, 4.0, 6.0, 6.0])
    weighted, weight = np.array([6.0, 1.0, 4.0]), np.array([2.0, 3.0, 1.0])
    expected = np.abs(repeated - 3.0).mean() - 0.5 * np.abs(repeated[:, None] - repeated).mean()
    assert crps_of_sample(weighted, weight, 3.0) == pytest.approx(expected)
    assert crps_of_sample(weighted, 10.0 * weight, 3.0) == pytest.approx(expected)


def test_crps_of_quantiles_nears_that_of_the_distribution() -> None:
    """199 levels of a normal: the integral over the levels by the nearest one is right to 1 %; seven to 15 %."""
    levels = np.arange(1, 200) / 200
    for truth in (-1.0, 0.2, 2.0):
        exact = truth * (2 * norm.cdf(truth) - 1) + 2 * norm.pdf(truth) - 1 / math.sqrt(math.pi)
        assert crps_of_quantiles(levels, norm.ppf(levels), truth) == pytest.approx(exact, rel=0.01)
        assert crps_of_quantiles(LEVELS, norm.ppf(LEVELS), truth) == pytest.approx(exact, rel=0.15)


def test_levels_ascend_and_a_bound_beyond_the_horizon_holds_what_never_came() -> None:
    for levels, quantiles in (((0.5, 0.4), (1.0, 2.0)), ((0.0, 0.5), (1.0, 2.0)), ((0.5,), (1.0, 2.0)), ((), ())):
        with pytest.raises(ValueError, match="levels must ascend"):
            crps_of_quantiles(levels, quantiles, 1.0)
    # a bound beyond the horizon holds what never came
    assert covered(5.0, None, None)
    assert covered(5.0, None, 9.0)
    assert not covered(5.0, None, 4.0)
    assert not covered(5.0, 8.0, None)
    assert covered(None, None, None)
    assert not covered(None, None, 9.0)


def test_the_pit_of_calibrated_predictions_is_uniform_and_of_sure_ones_is_not() -> None:
    """1,000 truths from N(0, 1): ten bins of 10 % ± 1 %; predictions half as wide fill the outer bins."""
    truths = np.random.default_rng(3).standard_normal(1_000)
    even = norm.ppf((np.arange(500) + 0.5) / 500)
    right = pit_histogram([pit_of_sample(even, np.ones(500), t) for t in truths])
    sure = pit_histogram([pit_of_sample(0.5 * even, np.ones(500), t) for t in truths])
    assert right.sum() == pytest.approx(1.0)
    assert pit_of_sample(np.array([1.0, 2.0, 3.0, 4.0]), np.ones(4), 2.0) == pytest.approx(0.375)
    assert np.abs(right - 0.1).max() < 0.04
    assert min(sure[0], sure[-1]) > 0.2


@pytest.mark.parametrize(("truth", "share"), [(3.0, 0.7), (0.5, 0.05), (9.0, 0.95)])
def test_the_pit_by_quantiles(truth: float, share: float) -> None:
    assert pit_of_quantiles((0.1, 0.5, 0.9), (1.0, 2.0, 4.0), truth) == pytest.approx(share)


def test_alpha_lambda_accuracy_and_the_prognostic_horizon() -> None:
    """At 600 of 1,000 cycles 400 remain: ±20 % is 320 to 480."""
    right = {319.0: False, 321.0: True, 479.0: True, 481.0: False, None: False}
    assert {predicted: alpha_lambda(predicted, 600.0, 1_000.0) for predicted in right} == right
    with pytest.raises(ValueError, match="no life left"):
        alpha_lambda(1.0, 1_000.0, 1_000.0)
    # the prognostic horizon counts from where all that follow are right
    at = [0.0, 250.0, 500.0, 750.0]
    assert prognostic_horizon(at, [1_050.0, 900.0, 480.0, 260.0], 1_000.0) == 500.0
    assert prognostic_horizon(at, [1_050.0, 800.0, 480.0, 260.0], 1_000.0) == 1_000.0
    assert prognostic_horizon(at, [1_050.0, 800.0, 480.0, None], 1_000.0) is None


# --- What earlier forecasts said about the tests since: which are judged, and how much wider remaining life is for
# it.

#: ξ is 1 for ever, with a deviation of 0.1 in the level of the draws.
SPREAD_LEVELS = 1.0 + 0.1 * np.linspace(-3.0, 3.0, 4_001)
WEIGHT = np.exp(-0.5 * np.square(np.linspace(-3.0, 3.0, 4_001)))
FLAT = draws_of(
    WEIGHT.size, weight=WEIGHT / WEIGHT.sum(), initial=SPREAD_LEVELS, change=0.0, scale=1.0, exponent=1.0, scatter=0.0
)


def measured(progress: float, value: float, *, variance: float = 0.0, epoch: int = 0) -> Measurement:
    return Measurement(progress=progress, value=value, variance=variance, epoch=epoch)


def forecast(posterior: TrackPosterior = FLAT) -> BackCast:
    """One, made at 1,000 cycles."""
    return BackCast.nothing().forecast(posterior, measured(1_000.0, 1.0), PRIOR)


def test_a_miss_is_counted_in_half_widths_of_the_interval() -> None:
    judged = forecast().judged(measured(1_500.0, 1.0 + 0.1 * 1.645)).judged(measured(1_600.0, 1.0 - 0.2 * 1.645))
    np.testing.assert_allclose(judged.misses, [1.0, -2.0], rtol=0.02)
    assert forecast().judged(measured(1_500.0, 60.0)).misses.tolist() == [3.0]  # however far off
    assert replace(judged, misses=np.array([0.9, 1.0, 1.1])).held == 2
    # scatter and the fits variance belong to the interval
    scattered = forecast(replace(FLAT, scatter=np.full(SPREAD_LEVELS.size, 0.1))).judged(measured(1_500.0, 1.2))
    uncertain = forecast().judged(measured(1_500.0, 1.2, variance=0.01))
    for judged in (scattered, uncertain):
        assert judged.misses[0] == pytest.approx(0.2 / 1.645 / math.hypot(0.1, 0.1), rel=0.02)


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
    [([], 1.0), ([0.5], 1.0), ([0.5, 3.0], 3.0), ([0.1] * 18 + [5.0], 5.0), ([0.1] * 38 + [2.0, 5.0], 2.0)],
)
def test_the_power_is_the_conformal_quantile_of_the_misses_of_its_side(misses: list[float], power: float) -> None:
    """Tests above their forecasts leave the safe bound as it is."""
    assert replace(BackCast.nothing(), misses=np.array(misses)).widening == (1.0, power)
    assert replace(BackCast.nothing(), misses=-np.array(misses)).widening == (power, 1.0)


@pytest.mark.parametrize(
    ("held", "count", "surprising"), [(0, 1, False), (3, 4, False), (16, 20, False), (15, 20, True), (6, 10, True)]
)
def test_few_that_held_are_a_surprise(held: int, count: int, surprising: bool) -> None:
    misses = np.array([0.5] * held + [2.0] * (count - held))
    assert replace(BackCast.nothing(), misses=misses).surprising is surprising


def test_a_clutch_that_becomes_better_than_predicted_is_no_less_safe() -> None:
    """Friction falls to 85 % of new and recovers to 94 %, above its forecasts: the safe bound stays that of the filter, of
    the order of the cycles that were tested."""
    share = np.array([1.0, 0.95, 0.91, 0.88, 0.86, 0.85, 0.86, 0.875, 0.89, 0.905, 0.92, 0.93, 0.935, 0.94])
    rng = np.random.default_rng(3)
    tests = sent(1_000.0 * np.arange(14), 0.1 * share * (1.0 + 0.002 * rng.standard_normal(14)), 1e-9)
    back_cast = BackCast.nothing()
    for count, test in enumerate(tests, start=1):
        back_cast, posterior = back_cast.judged(test), on_grid(tests[:count], 1_000, rng)
        if kept_after(count):
            back_cast = back_cast.forecast(posterior, test, PRIOR)
    assert back_cast.widening[1] > 2.0
    stated = stated_end(posterior, fraction=0.5, as_of=13_000.0, horizon=1e6, powers=back_cast.widening, tests=tests)
    bound = float(weighted_quantiles(np.minimum(stated.ends, 1e6), stated.weight, (0.05,))[0])
    assert 15_000.0 < bound < 40_000.0
