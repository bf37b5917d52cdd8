"""The standardised innovation against a filter that has not been given the last test at all."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import norm

from models.tracking.criteria import FAR, FEWEST_BEFORE
from models.tracking.filters.grid import Grid
from models.tracking.innovation import innovation, last_innovation
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from tests.models.tracking.tracked_series import PLAIN, PRIOR, TYPICAL, series

PROGRESS = np.linspace(0.0, 9_000.0, 10)
SCATTER = 4e-4


def measured(off: float) -> list[Measurement]:
    """Ten tests, the last off by so many deviations of the scatter."""
    tests = series(TYPICAL, PROGRESS, SCATTER)
    return [*tests[:-1], replace(tests[-1], value=tests[-1].value + off * SCATTER)]


def drawn(measurements: list[Measurement], prior=PLAIN) -> Posterior:
    grid = Grid()
    return grid.posterior(grid.from_history(prior, measurements), 8_000, np.random.default_rng(1))


def predicted(before: Posterior, last: Measurement) -> float:
    """Deviations of the last value by the mixture of normals that the tests before it predict."""
    middle = before.values(np.array([last.progress]))[0]
    below = before.weight @ norm.cdf(last.value, middle, np.sqrt(before.scatter**2 + last.variance))
    return float(ndtri(below))


@pytest.mark.parametrize("off", [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0])
def test_it_is_what_the_tests_before_predict(off: float) -> None:
    measurements = measured(off)
    expected = predicted(drawn(measurements[:-1]), measurements[-1])
    # 8,000 draws on either side, of which fewer carry the weight the farther off the test is
    assert innovation(drawn(measurements), measurements[-1], PLAIN) == pytest.approx(expected, rel=0.08, abs=0.03)


def test_draws_that_know_the_last_test_are_less_surprised_by_it() -> None:
    """The negative control: without the weights the innovation is too small."""
    measurements = measured(-3.0)
    posterior = drawn(measurements)
    assert innovation(posterior, measurements[-1], PLAIN) < predicted(posterior, measurements[-1]) - 1.0


def test_a_test_far_off_is_off_track_and_a_good_one_is_not() -> None:
    far, good = measured(-60.0), measured(0.0)
    innovation_far = last_innovation(drawn(far, PRIOR), far, PRIOR)
    assert innovation_far is not None
    assert innovation_far.off_track
    assert innovation_far.value < -FAR
    passed = last_innovation(drawn(good, PRIOR), good, PRIOR)
    assert passed is not None
    assert not passed.off_track


def test_nothing_is_off_track_after_few_tests_or_across_an_event() -> None:
    far = measured(-60.0)
    posterior = drawn(far, PRIOR)
    assert last_innovation(posterior, far[-FEWEST_BEFORE:], PRIOR) is None
    assert last_innovation(posterior, [*far[:-1], replace(far[-1], epoch=1)], PRIOR) is None
