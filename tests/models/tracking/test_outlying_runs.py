"""Runs that do not belong to the course: what is predicted of the next one, and which are outlying."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import norm

from models.degradation.general_order import DegradationLaw, value
from models.prognosis.first_passage import predict_first_passage
from models.tracking.criteria import FAR, FEWEST_BEFORE
from models.tracking.filters import grid as grid_module
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.innovation import innovation, next_innovation
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior
from tests.models.tracking.tracked_series import FILTERS, PLAIN, PRIOR, TYPICAL, followed, on_grid, sent, series

# --- The standardised innovation against a filter that has not been given the last test at all.

PROGRESS = np.linspace(0.0, 9_000.0, 10)
SCATTER = 4e-4


def measured(off: float) -> list[Measurement]:
    """Ten tests, the last off by so many deviations of the scatter."""
    tests = series(TYPICAL, PROGRESS, SCATTER)
    return [*tests[:-1], replace(tests[-1], value=tests[-1].value + off * SCATTER)]


def drawn(measurements: list[Measurement], prior=PLAIN) -> TrackPosterior:
    return on_grid(measurements, 8_000, np.random.default_rng(1), prior)


def predicted(before: TrackPosterior, last: Measurement) -> float:
    """Deviations of the last value by the mixture of normals that the tests before it predict."""
    middle = before.values(np.array([last.progress]))[0]
    below = before.weight @ norm.cdf(last.value, middle, np.sqrt(before.scatter**2 + last.variance))
    return float(ndtri(below))


@pytest.mark.parametrize("off", [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0])
def test_it_is_what_the_tests_before_predict(off: float) -> None:
    measurements = measured(off)
    before = drawn(measurements[:-1])
    expected = predicted(before, measurements[-1])
    assert innovation(before, measurements[-1], PLAIN) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_draws_that_know_the_last_test_are_less_surprised_by_it() -> None:
    """The negative control: compared with what was updated by it, a test is too near."""
    measurements = measured(-3.0)
    before, after = drawn(measurements[:-1]), drawn(measurements)
    assert innovation(before, measurements[-1], PLAIN) < innovation(after, measurements[-1], PLAIN) - 1.0


def test_a_test_far_off_is_off_track_after_enough_tests_without_an_event() -> None:
    """Above: a fall of that size is one that a knee may bring."""
    far, good = measured(60.0), measured(0.0)
    before, earlier = drawn(far[:-1], PRIOR), far[:-1]
    assert next_innovation(before, earlier, far[-1], PRIOR) > FAR
    assert -FAR < next_innovation(before, earlier, measured(-60.0)[-1], PRIOR) < -2.0
    assert abs(next_innovation(before, earlier, good[-1], PRIOR)) <= FAR
    # nothing is off track after few tests or across an event
    assert next_innovation(before, earlier[: FEWEST_BEFORE - 1], far[-1], PRIOR) is None
    assert next_innovation(before, earlier, replace(far[-1], epoch=1), PRIOR) is None


def test_after_a_knee_that_may_have_come_a_test_is_not_off_track() -> None:
    """A course with a discrepancy may have a knee between two tests: predicted before, it widens the prediction."""
    at = np.linspace(0.0, 8_000.0, 9)
    line = 0.1 * (1.0 - 0.4e-4 * at) * (1.0 + 0.004 * np.random.default_rng(1).standard_normal(at.size))
    before = drawn(sent(at, line, 1e-9), PRIOR)
    knee = before.discrepancy.knee
    test = sent([12_000.0], [0.1 * (1.0 - 0.4e-4 * 12_000.0) - 0.008], 1e-9)[0]
    without = replace(before, discrepancy=replace(before.discrepancy, knee=np.full(knee.size, np.inf)))
    assert abs(innovation(before, test, PRIOR)) < abs(innovation(without, test, PRIOR)) - 0.5


# --- Outlying runs are identified, alone and several at once, and widen the answer without turning it.


def test_one_outlying_run_widens_and_does_not_derail() -> None:
    """One of the last runs off by 10 %: every filter's median stays within 2 % of what it says without it, while filters
    that know of no outlying runs are off by more."""
    long = series(TYPICAL, np.linspace(0.0, 12_000.0, 19), 3e-4)
    outlying = [replace(m, value=1.1 * m.value) if i == 17 else m for i, m in enumerate(long)]

    def median(tracker: Any, prior: TrackPrior, measurements: list[Measurement]) -> float:
        posterior = tracker.posterior(followed(tracker, prior, measurements), 2_000, np.random.default_rng(1))
        return predict_first_passage(posterior, fraction=0.5, as_of=12_000.0).end_of_life[0.5]

    for tracker in FILTERS:
        clean = median(tracker, PRIOR, long)
        assert median(tracker, PRIOR, outlying) == pytest.approx(clean, rel=0.02)
    assert median(Grid(), replace(PRIOR, outlying_share=0.0), outlying) != pytest.approx(clean, rel=0.04)


def test_several_outlying_runs_that_hide_one_another_are_all_found() -> None:
    """Nine of sixty, either way: turning any one of them alone gains nothing."""
    rng = np.random.default_rng(3)
    long = series(TYPICAL, np.linspace(0.0, 14_000.0, 60), 4e-4)
    chosen = sorted(rng.choice(60, 9, replace=False).tolist())
    off = {index: 1.0 + 0.1 * sign for index, sign in zip(chosen, rng.choice([-1, 1], 9), strict=True)}
    measurements = [replace(m, value=off.get(i, 1.0) * m.value) for i, m in enumerate(long)]
    laid = Grid().laid(Grid().from_history(PRIOR, measurements))
    probability = np.einsum("k,kt->t", laid.mass.sum(axis=(1, 2, 3)), laid.kinds.outlying)
    assert np.flatnonzero(probability > 0.9).tolist() == chosen
    assert np.delete(probability, chosen).max() < 0.5


def test_a_run_a_little_off_may_be_outlying(monkeypatch: pytest.MonkeyPatch) -> None:
    """60 runs of little scatter, the 56th three and a half deviations off: how probable it is that it was outlying, by the
    particles and by the grid, within 0.06. The grid's first search is blurred and knows nothing of it."""
    scatter = 2.5e-4
    plain = series(TYPICAL, np.linspace(0.0, 14_000.0, 60), scatter, seed=5)
    sound = DegradationLaw(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7)
    off = float(value(np.array([plain[55].progress]), sound)[0]) + 3.6 * scatter
    measurements = [replace(m, value=off) if i == 55 else m for i, m in enumerate(plain)]

    def probability() -> float:
        laid = Grid().laid(Grid().from_history(PRIOR, measurements))
        return float(laid.mass.sum(axis=(1, 2, 3)) @ laid.kinds.outlying[:, 55])

    cloud = followed(Particle(), PRIOR, measurements).cloud
    share = np.exp(cloud.log_weight)
    expected = float(cloud.outlying[:, 55] @ share / share.sum())
    found = probability()
    monkeypatch.setattr(grid_module, "completed", lambda prior, history, kinds, frame, log_mass: (kinds, frame))  # noqa: ARG005
    assert 0.1 < expected < 0.9
    assert found == pytest.approx(expected, abs=0.06)
    assert probability() != pytest.approx(expected, abs=0.1)
