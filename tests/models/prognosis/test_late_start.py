"""A clutch whose first test is late: was it new at 0 cycles, or there?"""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.arrays import FloatArray
from models.degradation.general_order import DegradationLaw, first_passage, value
from models.prognosis.criteria import COUNTED_ELSEWHERE
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.stated_end import StatedEnd, late_start, stated_end
from models.tracking.courses import FORM_COURSE, FORM_SIZE, SCALE_SIGN, log_form_weight
from models.tracking.linear_model import EvaluationPoints
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior, weak
from tests import dense
from tests.models.tracking.tracked_series import on_grid, sent

LAW = DegradationLaw(initial=0.13, change=-0.1, scale=5_000.0, exponent=0.7)
END = float(first_passage(0.065, LAW))


def measured(progress: FloatArray, cof: FloatArray) -> list[Measurement]:
    return sent(progress, cof * (1.0 + 0.003 * np.random.default_rng(1).standard_normal(cof.size)))


def elsewhere(early: float, until: float = 0.6) -> list[Measurement]:
    """A straight line on a counter that began so many of its lives early."""
    share = np.linspace(0.0, until, 10)
    return measured(10_000.0 * (early + share), 0.1 * (1.0 - 0.5 * share))


def own(first: float, until: float) -> list[Measurement]:
    """A life of eq. 6 that is first tested at a share of it."""
    progress = END * np.linspace(first, until, 10)
    return measured(progress, value(progress, LAW))


def stated(tests: list[Measurement], *, weighing: bool = True) -> StatedEnd:
    posterior = on_grid(tests, 500, np.random.default_rng(1))
    known, as_of = tests if weighing else [], tests[-1].progress
    return stated_end(posterior, fraction=0.5, as_of=as_of, horizon=1e6, tests=known)


def interval(end: StatedEnd) -> list[float]:
    return weighted_quantiles(np.minimum(end.ends, 1e6), end.weight, (0.05, 0.95)).tolist()


def test_an_end_on_a_counter_that_began_with_another_clutch_is_held() -> None:
    tests = elsewhere(5.0)
    told = stated(tests)
    assert told.late.probability > 0.9
    low, high = interval(told)
    assert low < 60_000.0 < high
    assert low > tests[-1].progress
    assert told.late.initial == pytest.approx(0.1, rel=0.1)
    assert told.late.extrapolated > 0.2
    assert told.weight.sum() == pytest.approx(1.0)
    # led back to 0 cycles it is over
    assert interval(stated(tests, weighing=False))[0] < tests[-1].progress


@pytest.mark.parametrize("first", [0.1, 0.3])
def test_a_clutch_on_a_counter_of_its_own_is_stated_as_before(first: float) -> None:
    tests = own(first, 0.8)
    told, before = stated(tests), stated(tests, weighing=False)
    assert told.late.probability < 0.1
    assert interval(told)[0] == pytest.approx(interval(before)[0], rel=0.05)
    assert interval(told)[0] < END < interval(told)[1]


def test_a_clutch_is_alive_at_its_first_test() -> None:
    late = late_start(elsewhere(1.0), 0.5, offset=None, horizon=1e6)
    late, ends = replace(late, log_odds=0.0), np.array([9_000.0, 11_000.0, np.inf])
    probability, weight = late.weighed(ends, np.array([0.5, 0.3, 0.2]))
    assert probability == pytest.approx(2.0 / 3.0)
    np.testing.assert_allclose(weight, [0.0, 0.2, 0.4 / 3.0])
    probability, weight = late.weighed(ends[:1], np.ones(1))
    assert (probability, weight.tolist()) == (1.0, [0.0])


def test_which_first_tests_are_weighed_and_that_their_order_does_not_matter() -> None:
    assert late_start(own(0.03, 0.8), 0.5, offset=None, horizon=1e6) is None
    assert late_start(elsewhere(5.0)[:2], 0.5, offset=None, horizon=1e6) is None
    # tests that came in another order say the same
    tests = elsewhere(1.0)
    one, other = (late_start(each, 0.5, offset=None, horizon=1e6) for each in (tests, tests[::-1]))
    assert other.log_odds == pytest.approx(one.log_odds, abs=0.01)


def test_a_course_beside_counts_from_the_first_test() -> None:
    """An offset that doubles the value at 10,000 cycles, where the clutch is new, and is nothing later."""
    tests = elsewhere(1.0)
    plain = late_start(tests, 0.5, offset=None, horizon=1e6)
    doubled = late_start(tests, 0.5, offset=lambda zeta: np.where(zeta <= 10_000.0, 0.1, 0.0)[None], horizon=1e6)
    assert doubled.initial == pytest.approx(plain.initial + 0.1)
    assert np.median(doubled.ends) == pytest.approx(10_000.0, rel=0.05)


def test_the_probability_is_that_of_the_density_written_out_in_full() -> None:
    tests = sent([2_000.0, 4_000.0, 6_000.0], [0.1, 0.088, 0.077], 1e-6)
    told = late_start(tests, 0.5, offset=None, horizon=1e6)
    since = [replace(test, progress=test.progress - 2_000.0) for test in tests]
    log_odds = log_evidence(since) - log_evidence(tests) + math.log(COUNTED_ELSEWHERE / (1.0 - COUNTED_ELSEWHERE))
    assert told.log_odds == pytest.approx(log_odds, abs=0.25)  # 0.08 of it is the sample's


def log_evidence(tests: list[Measurement], count: int = 60_000) -> float:
    """By draws of the prior."""
    prior, rng = weak(tests[0], falling=True), np.random.default_rng(2)
    points = EvaluationPoints(
        log_scale=rng.normal(prior.log_scale_mean, prior.log_scale_sd, count),
        log_exponent=rng.normal(prior.log_exponent_mean, prior.log_exponent_sd, count),
        log_scatter=rng.normal(prior.log_scatter_mean, prior.log_scatter_sd, count),
        form=rng.choice(FORM_SIZE.size, size=count, p=np.exp(log_form_weight(prior))),
        outlying=(rng.random((len(tests), count)) < prior.outlying_share).astype(float),
    )
    log_likelihood = dense.log_likelihood(prior, tests, points)
    ended = (SCALE_SIGN[FORM_COURSE[points.form]] < 0.0) & (np.exp(points.log_scale) <= tests[-1].progress)
    return float(np.log(np.where(ended, 0.0, np.exp(log_likelihood)).mean()))


def test_a_fleets_prior_has_a_word_in_whether_it_was_new_later() -> None:
    """The same prior twice is that prior once. A fleet that ages as the clutch does makes it more probable than one whose
    clutches change within some 200 cycles."""
    tests = elsewhere(4.0)
    prior = weak(tests[0], falling=True)

    def log_odds(*priors: TrackPrior) -> float:
        shared = tuple((1.0 / len(priors), each) for each in priors)
        return late_start(tests, 0.5, offset=None, horizon=1e6, priors=shared).log_odds

    alone = late_start(tests, 0.5, offset=None, horizon=1e6).log_odds
    assert log_odds(prior) == pytest.approx(alone, abs=1e-9)
    assert log_odds(prior, prior) == pytest.approx(alone, abs=1e-9)
    alike = replace(prior, log_scale_mean=math.log(10_000.0), log_scale_sd=0.3, change_mean=-0.1, change_sd=0.02)
    short = replace(alike, log_scale_mean=math.log(200.0))
    assert log_odds(alike) > log_odds(alike, short) > log_odds(short)
