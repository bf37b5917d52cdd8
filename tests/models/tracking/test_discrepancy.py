"""The discrepancy beside eq. 6: its size, lives of another law, and steps at events."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models.prognosis.first_passage import ends_of_life, predict_first_passage, weighted_quantiles
from models.tracking.criteria import KNEE_HAZARD
from models.tracking.discrepancy import PAST, Discrepancy, drawn, smooth
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import NAMES, PRIOR, TYPICAL, followed, series


def test_a_course_has_the_deviation_that_its_size_says() -> None:
    """q · size at the end of what was measured (but for the corners of its stretches, 1/72 of it), (ζ/T)^1.5 of it
    later on, up to ten times as far."""
    variance = np.square(smooth(np.array([1.0, 4.0, 9.0, 500.0]) * 7e3, 7e3)).sum(axis=1)
    np.testing.assert_allclose(np.sqrt(variance), [1.0, 8.0, 27.0, 10.0**1.5], rtol=0.015)
    assert not smooth(np.array([0.0]), 7e3).any()


def test_what_was_measured_bends_as_the_course_beyond_it_does() -> None:
    """Up to T each draw's own time is ζ, and its δ a sum of terms; beyond, it is led on from stretch to stretch. Where both
    hold they are the same, on both sides of a step of the level."""
    rng, progress = np.random.default_rng(1), np.array([0.0, 900.0, 4_000.0, 4_001.0, 7_000.0])
    beside = Discrepancy(
        span=7_000.0,
        size=np.full(50, 0.1),
        curvature=rng.standard_normal((50, 22)),
        at=np.array([4_000.5]),
        height=rng.standard_normal((50, 1)),
        knee=np.full(50, np.inf),
        steepening=np.ones(50),
    )
    own = np.repeat(progress[:, None], 50, axis=1)
    np.testing.assert_allclose(beside.measured(progress), beside(own, progress[:, None]), rtol=0, atol=1e-13)
    assert np.abs(beside.measured(progress) - replace(beside, height=-beside.height).measured(progress)).max() > 1.0


def test_a_straight_line_is_no_eq_6_and_the_data_say_so() -> None:
    """COF falls on a line to 40 % of its loss, where eq. 6 would bend: the end of life is held, and is not by filters
    that are sure of eq. 6."""
    progress = np.linspace(0.0, 6_000.0, 20)
    rng = np.random.default_rng(4)
    values = 0.1 * (1.0 - 5e-5 * progress) * (1.0 + 0.002 * rng.standard_normal(20))
    line = [Measurement(progress=z, value=y, variance=1e-9) for z, y in zip(progress, values, strict=True)]
    prior = weak(line[0], falling=True)
    for tracker in (Grid(), Particle(), Ukf()):
        posterior = tracker.posterior(followed(tracker, prior, line), 1_000, np.random.default_rng(2))  # type: ignore[arg-type]
        found = predict_first_passage(posterior, fraction=0.5, as_of=6_000.0).end_of_life
        assert found[0.05] is not None
        assert found[0.05] < 10_000.0 < (found[0.95] or math.inf)
    sure = Grid().from_history(replace(prior, law_share=1.0, eq_6_share=1.0), line)
    told = predict_first_passage(Grid().posterior(sure, 1_000, np.random.default_rng(2)), fraction=0.5, as_of=6_000.0)
    assert told.end_of_life[0.05] is not None
    assert told.end_of_life[0.05] > 10_000.0


@pytest.mark.parametrize("tracker", [Grid(), Particle(), Ukf()], ids=NAMES)
def test_after_an_event_the_forecast_widens_and_then_settles(tracker: Any) -> None:
    """The level has stepped by 6 % at an oil change, after 12 runs: one run later the forecast is at least half as wide
    again as it would be without an event, and narrows with the runs that follow. The step is found."""
    progress = np.linspace(0.0, 12_000.0, 25)
    before = series(TYPICAL, progress, 3e-4)
    after = [m if i < 12 else replace(m, value=m.value + 0.06 * 0.134, epoch=1) for i, m in enumerate(before)]

    def width(measurements: list[Measurement]) -> float:
        posterior = tracker.posterior(followed(tracker, PRIOR, measurements), 2_000, np.random.default_rng(1))
        ends = predict_first_passage(posterior, fraction=0.5, as_of=measurements[-1].progress).end_of_life
        assert ends[0.05] is not None
        return (ends[0.95] or 1e6) - ends[0.05]

    assert width(after[:13]) > 1.5 * width(before[:13])
    assert width(after) < 0.5 * width(after[:13])
    posterior = tracker.posterior(followed(tracker, PRIOR, after), 2_000, np.random.default_rng(1))
    step = posterior.moments(posterior.discrepancy.height.sum(axis=1))
    assert step[0] == pytest.approx(0.06 * 0.134, abs=3.0 * step[1])
    assert step[1] < 0.3 * 0.06 * 0.134


def test_a_course_goes_on_along_its_knee_from_there_on() -> None:
    """From ζ = 1,500 on at four times the mean pace until then, which is a line's own; before, nothing changes."""
    line = Posterior(
        weight=np.full(2, 0.5),
        initial=np.full(2, 0.1),
        change=np.full(2, -0.1),
        scale=np.full(2, -10_000.0),
        exponent=np.full(2, -1.0),
        scatter=np.full(2, 0.001),
        discrepancy=Discrepancy(
            span=1_000.0,
            size=np.full(2, 0.01),
            curvature=np.zeros((2, 22)),
            at=np.zeros(0),
            height=np.zeros((2, 0)),
            knee=np.array([1_500.0, np.inf]),
            steepening=np.full(2, 4.0),
        ),
    )
    at = np.array([0.0, 1_000.0, 1_500.0, 2_000.0])
    np.testing.assert_allclose(line.values(at).T, [[0.1, 0.09, 0.085, 0.06], [0.1, 0.09, 0.085, 0.08]], atol=1e-12)
    assert ends_of_life(line, 0.5) == pytest.approx([2_200.0, 5_000.0], rel=2e-3)


def test_knees_come_as_their_hazard_has_it_and_eq_6_alone_has_none() -> None:
    prior = weak(Measurement(progress=0.0, value=0.1, variance=0.0), falling=True)
    history = History.of([Measurement(progress=x, value=0.1, variance=0.0) for x in (0.0, 2_000.0)], prior)
    sizes = np.repeat([0.0, 0.03], 20_000)
    beside = drawn(history, prior, sizes, np.zeros((sizes.size, PAST)), np.random.default_rng(4))
    assert np.isinf(beside.knee[:20_000]).all()
    for ahead in (1.5, 3.0):
        assert (beside.knee[20_000:] > ahead * 2_000.0).mean() == pytest.approx(ahead**-KNEE_HAZARD, abs=0.015)
    assert beside.knee.min() >= 2_000.0
    parameter = weak(Measurement(progress=0.0, value=0.1, variance=0.0), falling=False)
    assert np.isinf(drawn(history, parameter, sizes, np.zeros((sizes.size, PAST)), np.random.default_rng(4)).knee).all()


def test_the_first_signs_of_a_knee_move_the_answer_within_two_tests() -> None:
    """An even course that goes six times as fast from 7,000 cycles on and ends at 10,000, a test every 400."""
    rng = np.random.default_rng(1)
    at = np.arange(0.0, 8_000.1, 400.0)
    share = np.where(at < 7_000.0, 0.4e-4 * at, 0.28 + 2.4e-4 * (at - 7_000.0))
    values = 0.1 * (1.0 - 0.5 * share) * (1.0 + 0.003 * rng.standard_normal(at.size))
    tests = [Measurement(progress=x, value=y, variance=1e-9) for x, y in zip(at.tolist(), values.tolist(), strict=True)]
    said = []
    for count in (18, 20):
        posterior = Grid().posterior(Grid().from_history(weak(tests[0], falling=True), tests[:count]), 1_000, rng)
        said.append(weighted_quantiles(np.minimum(ends_of_life(posterior, 0.5), 1e6), posterior.weight, (0.05, 0.5)))
    (_, before), (low, after) = said
    assert before > 15_000.0
    assert low < 10_000.0
    assert after < 12_000.0
