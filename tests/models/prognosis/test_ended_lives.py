"""What ended lives say: where they ended, and how right forecasts of them were."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import log_ndtr

from models.prognosis.ended_lives import EndedLife, calibrated, declared_end, ended_life, representative
from models.prognosis.first_passage import weighted_quantiles
from models.tracking.measurement import Measurement

ENDS = 1_000.0 * np.exp(0.08 * np.array([-1.5, -1.0, -0.6, -0.3, 0.0, 0.1, 0.4, 0.7, 1.1, 1.6]))


def ended(end: float, off: float = 1.0, spread: float = 0.05) -> EndedLife:
    """A life whose forecasts were `off` times its end throughout, with that deviation of the logarithm."""
    stated = math.log(off * end) + 1.645 * spread * np.array([-1.0, 0.0, 1.0])
    return EndedLife(end=end, fraction=0.5, progress=np.array([100.0, 500.0]), forecasts=np.array([stated, stated]))


def quantiles(own: EndedLife, lives: list[EndedLife], as_of: float = 400.0) -> list[float]:
    stated = calibrated(own.forecasts[0], as_of, [life for life in lives if life.end > as_of])
    assert stated is not None
    ends, weight = stated
    assert weight.sum() == pytest.approx(1.0)
    assert ends.min() > as_of
    return [float(x) for x in weighted_quantiles(ends, weight, (0.05, 0.5, 0.95))]


def test_forecasts_that_were_right_decide() -> None:
    lives = [ended(end, off) for end, off in zip(ENDS, np.exp(0.05 * np.sin(np.arange(10.0))), strict=True)]
    low, middle, high = quantiles(ended(1_150.0), lives)
    assert 1_060.0 < middle < 1_160.0
    assert 0.1 < math.log(high / low) < 0.25


def test_forecasts_that_are_late_are_led_back_to_the_ends() -> None:
    """All 22 times too late, as of a course that accelerates: what is left is where the others ended."""
    scatter = 22.0 * np.exp(0.9 * np.cos(3.0 * np.arange(10.0)))
    lives = [ended(end, off, 0.3) for end, off in zip(ENDS, scatter, strict=True)]
    low, middle, high = quantiles(ended(1_000.0, 15.0, 0.3), lives)
    assert (low, middle, high) == pytest.approx((860.0, 1_005.0, 1_175.0), rel=0.05)


def test_a_hundred_of_a_thousand_say_the_same() -> None:
    rng = np.random.default_rng(2)
    lives = [ended(1_000.0 * math.exp(off), 1.0 + 0.1 * off) for off in rng.normal(0.0, 0.2, 1_000).tolist()]
    some = representative(lives)
    assert len(some) == 100
    assert {life.end for life in some} >= {min(life.end for life in lives), max(life.end for life in lives)}
    own = ended(1_100.0, 1.0, 0.3)
    assert quantiles(own, some) == pytest.approx(quantiles(own, lives), rel=0.02)
    assert representative(lives[:100]) == lives[:100]


def test_it_is_alive_now() -> None:
    lives = [ended(end) for end in ENDS]
    low, _, _ = quantiles(ended(900.0), lives, as_of=1_000.0)
    assert low > 1_000.0
    assert calibrated(ended(1_200.0).forecasts[0], 1_100.0, lives[8:]) is None


def test_the_sample_is_of_the_density_that_is_stated() -> None:
    """Against the product of the two predictives, summed up on a fine even grid of T."""
    lives = [ended(end, off) for end, off in zip(ENDS, np.exp(0.1 * np.sin(np.arange(10.0))), strict=True)]
    own = ended(1_050.0, 1.0, 0.2)
    found = quantiles(own, lives)
    log_ends = np.log(ENDS)
    deviations = np.array([0.05] * 10 + [0.2])
    size = np.sqrt(deviations) * math.exp(np.log(np.sqrt(deviations)).mean())
    errors = -0.1 * np.sin(np.arange(10.0)) / size[:-1]
    ends = np.linspace(400.0, 10_000.0, 400_001)[1:]
    log_density = np.zeros(ends.size)
    for values, shift, unit, vague, (shape, rate) in (
        (log_ends - np.median(log_ends), np.median(log_ends), 1.0, 10.0, (1.0, 0.01)),
        (errors, math.log(1_050.0), size[-1], 1.0, (1.0, 1.0)),
    ):
        worth = 10 + vague**-2
        mean = values.sum() / worth
        a, b = shape + 5.0, rate + 0.5 * ((values**2).sum() - worth * mean**2)
        x = ((np.log(ends) - shift) / unit - mean) / math.sqrt(b / a * (1 + 1 / worth))
        log_density -= (a + 0.5) * np.log1p(x**2 / (2 * a))
    weight = np.exp(log_density - log_density.max()) / ends  # a density of log T
    expected = weighted_quantiles(ends, weight, (0.05, 0.5, 0.95))
    assert found == pytest.approx(expected.tolist(), rel=2e-3)


def test_a_life_counts_in_other_units_alike() -> None:
    lives = [ended(end) for end in ENDS]
    own = ended(1_100.0)
    found = quantiles(own, lives)
    halves = quantiles(own.in_unit(2.0), [life.in_unit(2.0) for life in lives], as_of=200.0)
    assert [2.0 * x for x in halves] == pytest.approx(found)
    assert EndedLife.from_dict(own.to_dict()).forecasts.tolist() == own.forecasts.tolist()


def test_an_ended_life_has_forecasts_of_its_own_end() -> None:
    """Eq. 6 with ε = 1 and Δ = -1: half is left at ζ = φ = 1,000."""
    rng = np.random.default_rng(3)
    history = [
        Measurement(progress=x, value=0.1 * (1.0 / (1.0 + x / 1_000.0) + 0.003 * rng.standard_normal()), variance=0.0)
        for x in np.linspace(0.0, 1_200.0, 13)
    ]
    life = ended_life(history, 1_000.0, fraction=0.5, horizon=1e6)
    assert life is not None
    assert life.progress.tolist() == [200.0, 300.0, 500.0, 700.0]
    low, _, high = life.forecasts[-1]
    assert low < math.log(1_000.0) < high
    assert ended_life(history[:2], 1_000.0, fraction=0.5, horizon=1e6) is None


def by_draws(lives: list[EndedLife], own: EndedLife, as_of: float) -> list[float]:
    """The same by brute force: means and deviations drawn from their priors, weighted by all that is known of every life."""
    rng = np.random.default_rng(5)
    deviations = np.array(
        [0.05 if life.forecasts[0, 2] - life.forecasts[0, 0] < 0.2 else 0.3 for life in [*lives, own]]
    )
    size = np.sqrt(deviations) * math.exp(np.log(np.sqrt(deviations)).mean())
    log_ends = np.array([math.log(life.end) for life in lives])
    centre = float(np.median([math.log(life.end) for life in lives if not life.censored]))
    median = np.array([life.forecasts[0, 1] for life in [*lives, own]])
    log_end = np.linspace(math.log(as_of), math.log(10_000.0), 4_001)[1:]
    log_density = np.zeros(log_end.size)
    for values, unit, of_value, vague, (shape, rate) in (
        (log_ends - centre, np.ones(len(lives)), log_end - centre, 10.0, (1.0, 0.01)),
        ((log_ends - median[:-1]) / size[:-1], size[:-1], (log_end - median[-1]) / size[-1], 1.0, (1.0, 1.0)),
    ):
        sigma = np.sqrt(rate / rng.gamma(shape, size=400_000))
        mean = vague * sigma * rng.standard_normal(sigma.size)
        log_weight = np.zeros(sigma.size)
        for life, value, one in zip(lives, values, unit, strict=True):
            if life.censored:
                log_weight += log_ndtr((mean - value) / sigma)
            else:
                squares = (value - mean) ** 2 + (life.deviation / one) ** 2
                log_weight += -0.5 * squares / sigma**2 - np.log(sigma)
        best = np.argsort(log_weight)[-20_000:]
        weight = np.exp(log_weight[best] - log_weight[best].max())
        chosen = rng.choice(best, 2_000, p=weight / weight.sum())
        off = (of_value[:, None] - mean[chosen]) / sigma[chosen]
        log_density += np.log((np.exp(-0.5 * off**2) / sigma[chosen]).mean(axis=1) + 1e-300)
    share = np.exp(log_density - log_density.max())
    return [float(np.exp(log_end[np.searchsorted(np.cumsum(share) / share.sum(), q)])) for q in (0.05, 0.5, 0.95)]


def some_censored() -> list[EndedLife]:
    """Ten lives of which three were taken out at four fifths of their end, and two are known to a tenth."""
    lives = [ended(end, off) for end, off in zip(ENDS, np.exp(0.1 * np.sin(np.arange(10.0))), strict=True)]
    for number in (6, 8, 9):
        lives[number] = replace(lives[number], end=0.8 * lives[number].end, censored=True)
    return [replace(life, deviation=0.1) if number < 2 else life for number, life in enumerate(lives)]


def test_uncertain_and_censored_ends_are_weighed_as_by_brute_force() -> None:
    """Within 2 %: the other way is drawn."""
    own = ended(1_050.0, 1.0, 0.3)
    assert quantiles(own, some_censored()) == pytest.approx(by_draws(some_censored(), own, 400.0), rel=0.02)


def test_a_life_that_was_taken_out_says_that_its_end_was_later() -> None:
    """Not that it was then; and one that was taken out early says next to nothing."""
    own = ended(1_050.0, 22.0, 0.3)
    known = [ended(end, 22.0 * math.exp(0.9 * math.cos(3.0 * n)), 0.3) for n, end in enumerate(ENDS[:7])]
    out = [replace(life, end=1_100.0, censored=True) for life in known[:3]]
    without, with_these = quantiles(own, known), quantiles(own, known + out)
    as_ends = quantiles(own, known + [replace(life, censored=False) for life in out])
    assert with_these[1] > as_ends[1] > without[1]
    early = quantiles(own, known + [replace(life, end=500.0) for life in out])
    assert early == pytest.approx(without, rel=0.01)


def test_lives_that_were_taken_out_are_not_counted_as_ends() -> None:
    lives = [ended(end) for end in ENDS]
    assert calibrated(lives[0].forecasts[0], 400.0, lives[:3]) is not None
    assert calibrated(lives[0].forecasts[0], 400.0, [*lives[:2], replace(lives[2], censored=True)]) is None


def accelerating(until: float) -> list[Measurement]:
    """Mean COF that passes half of its 0.1 at ζ = 1000, ever faster, at 25 even tests of that life up to `until`."""
    at = np.arange(0.0, until + 1e-9, 40.0)
    return [Measurement(progress=x, value=0.1 - 0.05 * (x / 1_000.0) ** 2, variance=1e-8) for x in at.tolist()]


@pytest.mark.parametrize("stopped", [960.0, 880.0])
def test_a_life_that_is_declared_worn_before_its_threshold_ends_near_it(stopped: float) -> None:
    end, deviation = declared_end(accelerating(stopped), stopped, fraction=0.5, horizon=1e6)
    assert stopped < end < 1_060.0
    assert abs(math.log(end / 1_000.0)) < 3.0 * deviation + 0.01
    assert deviation < 0.06


def test_a_life_without_wear_that_is_declared_worn_ended_then() -> None:
    """Nothing in its tests says so, so its end is uncertain, and not ten times as late."""
    level = [Measurement(progress=x, value=0.1, variance=1e-8) for x in np.arange(0.0, 1_000.0, 50.0).tolist()]
    end, deviation = declared_end(level, 1_000.0, fraction=0.5, horizon=1e6)
    assert 1_000.0 <= end < 1_500.0
    assert 0.0 < deviation < 0.5


def test_uncertain_and_censored_ends_are_stored_exactly() -> None:
    for life in some_censored():
        assert EndedLife.from_dict(life.to_dict()).to_dict() == life.to_dict()
