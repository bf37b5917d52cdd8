"""What ended lives say of the next: where they ended, and along which course."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import expit, log_ndtr
from scipy.stats import linregress, multivariate_normal

from models.arrays import FloatArray
from models.degradation import general_order
from models.degradation.general_order import DegradationLaw, first_passage
from models.prognosis import ended_lives
from models.prognosis.criteria import COURSE_DISCREPANCIES, COURSE_SCATTERS, COURSE_SIZE_SD, OTHER_KIND, VAGUE
from models.prognosis.ended_lives import (
    Kin,
    ObservedLife,
    as_its_kind,
    declared_end,
    ended_life,
    representative,
    severity_exponent,
)
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.stated_end import stated_end
from models.tracking.courses import FORM_SIZE, CourseForm
from models.tracking.criteria import LEVEL_SIZE, STEP_SIZE
from models.tracking.measurement import Measurement
from tests.models.prognosis.sample_scores import crps_of_sample
from tests.models.tracking.tracked_series import on_grid, sent
from tests.statistical.lives import taught

ENDS = 1_000.0 * np.exp(0.2 * np.array([-1.5, -1.0, -0.6, -0.3, 0.0, 0.1, 0.4, 0.7, 1.1, 1.6]))

#: The share of the way to the threshold over the share of life.
Shape = Callable[[FloatArray], FloatArray]


def knee(share: FloatArray) -> FloatArray:
    """Slow until 0.7 of a life, then six times as fast."""
    return np.where(share < 0.7, 0.4 * share, 0.28 + 2.4 * (share - 0.7))


def slowing(share: FloatArray) -> FloatArray:
    return np.log1p(20.0 * share) / math.log(21.0)


def measured(
    end: float, until: float, shape: Shape = knee, seed: int = 1, scatter: float = 0.002, step: float = 0.0
) -> list[Measurement]:
    """Tests at every 30th of a life that ends at `end`, up to a share of it; `step` is what an event at its third adds."""
    rng = np.random.default_rng(seed)
    shares = np.arange(0.0, until + 1e-9, 1.0 / 30.0)
    values = 0.1 * (1.0 - 0.5 * shape(shares)) * (1.0 + scatter * rng.standard_normal(shares.size))
    later = (shares > 1.0 / 3.0) & (step != 0.0)
    return sent(end * shares, values + 0.1 * step * later, 1e-8, later)


def ended(end: float, shape: Shape = knee, seed: int = 0) -> ObservedLife:
    tests = measured(end, 1.0, shape, seed)
    progress, values = (np.array(column) for column in zip(*((t.progress, t.value) for t in tests), strict=True))
    return ended_life(progress, values, end, initial=0.1, fraction=0.5)


def lives(shape: Shape = knee) -> list[ObservedLife]:
    return [ended(end, shape, number) for number, end in enumerate(ENDS)]


def said(tests: list[Measurement], of: list[ObservedLife]) -> Kin:
    kin = as_its_kind(tests, tests[-1].progress, of)
    assert kin.weight.sum() == pytest.approx(1.0)
    return kin


def quantiles(kin: Kin) -> list[float]:
    return weighted_quantiles(kin.ends, kin.weight, (0.05, 0.5, 0.95)).tolist()


def of_kind(kin: Kin) -> float:
    """The probability that a clutch that takes one of their courses is of the kind."""
    return float(expit(kin.log_odds + math.log((1.0 - OTHER_KIND) / OTHER_KIND)))


@pytest.mark.parametrize("until", [0.4, 0.6, 0.8])
def test_a_knee_that_the_others_had_is_expected_before_its_first_sign(until: float) -> None:
    kin = said(measured(1_200.0, until), lives())
    low, middle, high = quantiles(kin)
    assert low < 1_200.0 < high
    assert 1_050.0 < middle < 1_250.0  # between their median and its own course: the ends count too
    assert high / low < 1.7
    assert of_kind(kin) > 0.9


def test_the_course_says_more_than_where_the_others_ended() -> None:
    """A life of 1.6 times their median comes less far than they had, and is expected the later the longer that goes on."""
    tests = measured(1_600.0, 0.8, seed=3)
    early, late = (quantiles(said(tests[:count], lives()))[1] for count in (13, 22))
    assert 1_200.0 < early < late
    assert late == pytest.approx(1_600.0, rel=0.1)


def test_two_ended_lives_count_and_one_or_those_taken_out_do_not() -> None:
    tests, some = measured(1_200.0, 0.5), lives()
    assert as_its_kind(tests, 600.0, some[4:6]) is not None
    assert as_its_kind(tests, 600.0, some[4:5]) is None
    assert as_its_kind(tests, 600.0, [some[4], replace(some[5], censored=True)]) is None
    assert as_its_kind(tests[:2], 600.0, some) is None


def test_a_clutch_that_wears_otherwise_is_hardly_of_the_kind() -> None:
    """It falls at once as none of them did: to a half by a sixth of their shortest life."""
    tests = measured(125.0, 0.9, slowing)
    assert of_kind(said(tests, lives())) < 0.1
    assert of_kind(said(tests, [each.in_unit(7.0) for each in lives(slowing)])) > 0.9


def test_a_declared_step_of_the_level_is_no_wear() -> None:
    """An oil change that lifts COF by a twentieth: the end is stated as without it, somewhat less surely."""
    plain, stepped = (quantiles(said(measured(1_100.0, 0.85, step=step), lives())) for step in (0.0, 0.02))
    assert stepped[1] == pytest.approx(plain[1], rel=0.1)
    assert stepped[0] < 1_150.0 < stepped[2]


def lawful(end: float, until: float, seed: int) -> list[Measurement]:
    """A life that follows eq. 6, of a kind that does: what is lost and how fast scatter from life to life."""
    rng = np.random.default_rng(seed)
    change, scale = -0.075 * math.exp(0.05 * rng.standard_normal()), 0.5 * math.exp(0.2 * rng.standard_normal())
    law = DegradationLaw(initial=0.1, change=change, scale=scale, exponent=0.7)
    stretch = end / float(first_passage(0.05, law))
    shares = np.arange(0.0, until + 1e-9, 1.0 / 30.0) * end
    return sent(shares, general_order.value(shares / stretch, law) * (1.0 + 0.003 * rng.standard_normal(shares.size)))


@pytest.fixture(scope="module")
def eq_6_kind() -> list[ObservedLife]:
    return [taught(lawful(end, 1.0, seed), end) for seed, end in enumerate(ENDS)]


def test_whole_courses_tell_a_kind_that_follows_eq_6_from_one_with_knees(eq_6_kind: list[ObservedLife]) -> None:
    assert np.mean([life.laws[CourseForm.EQ_6] for life in eq_6_kind]) > 0.8
    assert max(sum(taught(measured(end, 1.0, seed=3), end).laws) for end in ENDS[:3]) < 0.1


def mean_crps(stage: float, ended_by: list[ObservedLife], course: Callable[..., list[Measurement]] = lawful) -> float:
    """Of lives at a share of them, in lives; `course` has their tests by end, share and seed."""
    found = []
    for seed, end in enumerate((800.0, 1_000.0, 1_300.0), start=20):
        tests = course(end, stage, seed=seed)
        posterior, as_of = on_grid(tests, 500, np.random.default_rng(seed)), tests[-1].progress
        stated = stated_end(posterior, fraction=0.5, as_of=as_of, horizon=1e6, ended=ended_by, tests=tests)
        assert stated.weight.sum() == pytest.approx(1.0)
        found.append(crps_of_sample(np.minimum(stated.ends, 1e6), stated.weight, end) / end)
    return float(np.mean(found))


@pytest.mark.parametrize("count", [2, 3, 4, 10])
def test_ended_lives_of_its_kind_help_and_late_in_a_life_do_not_spoil_what_its_own_tests_say(eq_6_kind, count):
    some = [eq_6_kind[index] for index in np.linspace(0, 9, count).round().astype(int).tolist()]
    assert mean_crps(0.4, some) < 0.8 * mean_crps(0.4, [])
    assert mean_crps(0.8, some) < 1.2 * mean_crps(0.8, [])


def straight(share: FloatArray) -> FloatArray:
    return share


@pytest.mark.parametrize("shape", [straight, slowing])
def test_two_ended_lives_teach_the_filter_their_law_whichever_it_is(shape: Shape) -> None:
    """Late in a life, where the filter knows the end better than any stretched course."""
    course = partial(measured, shape=shape, scatter=0.003)
    some = [taught(course(end, 1.0, seed=seed), end) for seed, end in enumerate(ENDS[3:7:3].tolist())]
    assert mean_crps(0.8, some, course) < mean_crps(0.8, [], course)


@pytest.mark.parametrize(("longer", "stage"), [(0.2, 0.8), (4.0, 0.8), (4.0, 0.7)])
def test_ended_lives_of_another_kind_do_not_move_the_end_once_its_own_tests_speak(eq_6_kind, longer, stage):
    tests = lawful(1_000.0, stage, 21)
    posterior, as_of = on_grid(tests, 500, np.random.default_rng(21)), tests[-1].progress
    stated_by = []
    for others in ([life.in_unit(1.0 / longer) for life in eq_6_kind], []):
        stated = stated_end(posterior, fraction=0.5, as_of=as_of, horizon=1e6, ended=others, tests=tests)
        stated_by += weighted_quantiles(np.minimum(stated.ends, 1e6), stated.weight, (0.05, 0.5, 0.95)).tolist()
    assert stated_by[:3] == pytest.approx(stated_by[3:], rel=0.02)


def test_what_is_behind_stays_behind_and_one_draw_that_agrees_is_no_certainty() -> None:
    kin = said(measured(1_100.0, 0.6), lives())
    own, weight = np.array([600.0, 900.0, 1_200.0, np.inf]), np.array([0.1, 0.3, 0.4, 0.2])
    for share in (0.0, 0.9):
        ends, given = replace(kin, lawful=share).together(own, weight, np.zeros(4, dtype=np.intp), 660.0)
        assert given.sum() == pytest.approx(1.0)
        assert given[ends <= 660.0].sum() == pytest.approx(0.1)
    # Of a filter whose draws end, where at all, far from where the others did but for one.
    own = np.concatenate([[1_100.0], np.geomspace(2_000.0, 1e6, 199), np.full(300, np.inf)])
    ends, given = replace(kin, lawful=1.0).together(own, np.full(500, 0.002), np.zeros(500, dtype=np.intp), 660.0)
    low, high = weighted_quantiles(np.minimum(ends, 1e6), given, (0.05, 0.5))
    assert high > 1.2 * low


@pytest.mark.parametrize("log_odds", [1.0, 20.0])
def test_courses_that_fit_a_clutch_do_not_take_the_share_of_its_filter(log_odds: float) -> None:
    """Of a kind of which four in five follow eq. 6, as its courses did as well; but where its tests speak against eq. 6."""
    kin = said(measured(1_100.0, 0.6), lives())
    own, weight, lean = np.linspace(500.0, 1_500.0, 100), np.full(100, 0.01), np.zeros(FORM_SIZE.size)
    lean[0], other = 0.8, 7
    kin = replace(kin, lawful=0.8, lean=lean, log_odds=log_odds)
    for against, courses in ((0, 0.2), (75, 0.5), (100, 1.0)):
        form = np.where(np.arange(100) * 37 % 100 < against, other, 0)
        _, given = kin.together(own, weight, form, 660.0)
        assert given[-kin.ends.size :].sum() == pytest.approx(courses * weight[own > 660.0].sum(), rel=0.05)


def test_the_predictive_is_a_density_with_censored_ends_and_without() -> None:
    at = np.linspace(-6.0, 6.0, 4_001)
    values = np.array([-0.2, 0.0, 0.1, 0.3])
    for exact in (np.ones(4, dtype=bool), np.array([True, True, True, False])):
        density = np.exp(ended_lives._predictive(values, np.zeros(4), exact, VAGUE, (1.0, 0.03)).log_density(at))
        assert density.sum() * (at[1] - at[0]) == pytest.approx(1.0, abs=0.01)


def test_a_clutch_is_alive_now_and_one_that_has_outlived_all_of_them_by_far_is_not_of_their_kind() -> None:
    """At an age that most of the others did not reach."""
    low, _, _ = quantiles(said(measured(1_500.0, 0.8), lives()))
    assert low > 1_200.0
    # a clutch that has outlived all of them by far is not of their kind
    tests = measured(8_000.0, 0.6)
    assert of_kind(said(tests, lives())) < 0.1


@pytest.mark.parametrize(("new_level", "size"), [(0, STEP_SIZE), (1, LEVEL_SIZE)])
def test_the_evidence_is_that_of_the_normal_written_out(new_level: int, size: float) -> None:
    """Of every course, end and pair of deviations, with x, a, the step and δ integrated out: by dense covariances."""
    tests = [replace(t, new_levels=new_level * t.epoch) for t in measured(1_100.0, 0.5, step=0.02)]
    seen = ended_lives._Decline.of(tests, None, 0.5)
    log_end = np.log([900.0, 1_300.0])
    progress, damage = seen.progress, (1.0 - np.array([t.value for t in tests]) / tests[0].value) / 0.5
    own = lives()[3:5]
    courses = np.stack([life.course(progress / np.exp(log_end)[:, None]) for life in own])
    found = seen.nodes(log_end, courses).log_evidence
    later = np.array([float(t.epoch) for t in tests])
    low, high = np.minimum(progress, progress[:, None]), np.maximum(progress, progress[:, None])
    expected = np.empty(found.shape)
    for e, end in enumerate(np.exp(log_end)):
        walk = 0.5 * low**2 * (3.0 * high - low) / end**3
        pairs = [(q, s) for q in COURSE_DISCREPANCIES for s in COURSE_SCATTERS]
        for k, (q, s) in enumerate(pairs):
            for j in range(2):
                b = courses[j, e]
                covariance = q**2 * walk + s**2 * np.eye(b.size) + 0.25 * np.ones((b.size, b.size))
                covariance += COURSE_SIZE_SD**2 * np.outer(b, b) + (size / 0.5) ** 2 * np.outer(later, later)
                expected[e, k, j] = multivariate_normal(b, covariance).logpdf(damage)
    assert found - found[0, 0, 0] == pytest.approx(expected - expected[0, 0, 0], abs=1e-5)


def test_forty_of_a_thousand_say_the_same() -> None:
    rng = np.random.default_rng(2)
    many = [ended(1_000.0 * math.exp(off)) for off in rng.normal(0.0, 0.2, 1_000).tolist()]
    some = representative(many)
    assert len(some) == 40
    assert {life.end for life in some} >= {min(life.end for life in many), max(life.end for life in many)}
    tests = measured(1_100.0, 0.6)
    assert quantiles(said(tests, some)) == pytest.approx(quantiles(said(tests, many[:200])), rel=0.05)
    assert representative(many[:40]) == many[:40]


def test_a_life_counts_in_other_units_alike() -> None:
    tests = measured(1_100.0, 0.6)
    halves = [replace(test, progress=0.5 * test.progress) for test in tests]
    found = quantiles(said(halves, [life.in_unit(2.0) for life in lives()]))
    assert [2.0 * x for x in found] == pytest.approx(quantiles(said(tests, lives())))


def test_an_ended_life_has_the_course_of_its_tests_until_its_end_and_is_stored_exactly() -> None:
    progress = np.array([300.0, 0.0, 300.0, 600.0, 1_200.0])
    values = np.array([0.09, 0.1, 0.08, 0.07, 0.04])
    life = ended_life(progress, values, 1_000.0, initial=0.1, fraction=0.5)
    assert life.progress == (0.0, 300.0, 600.0)
    assert life.damage == pytest.approx((0.0, 0.3, 0.6))
    assert life.course(np.array([0.3, 0.8, 1.0, 1.5])).tolist() == pytest.approx([0.3, 0.8, 1.0, 1.5])
    assert ended_life(progress[:3], values[:3], 1_000.0, initial=0.1, fraction=0.5) is None
    # ended lives are stored exactly
    for life in (lives()[0], replace(lives()[0], deviation=0.1), replace(lives()[1], censored=True)):
        assert ObservedLife.from_dict(life.to_dict()) == life


def test_uncertain_and_censored_ends_are_weighed_as_by_brute_force() -> None:
    """The predictive of log ends, by means and deviations drawn from their priors and weighted; within 2 %."""
    rng = np.random.default_rng(5)
    values = np.array([-0.3, -0.2, -0.05, 0.0, 0.1, 0.15, -0.1, 0.12])
    variance = np.array([0.01, 0.01, *np.zeros(6)])
    exact = np.array([True] * 6 + [False] * 2)
    shape, rate = 1.0, 0.03
    sigma = np.sqrt(rate / rng.gamma(shape, size=400_000))
    mean = VAGUE * sigma * rng.standard_normal(sigma.size)
    log_weight = np.zeros(sigma.size)
    for value, own, known in zip(values, variance, exact, strict=True):
        squares = (value - mean) ** 2 + own
        log_weight += -0.5 * squares / sigma**2 - np.log(sigma) if known else log_ndtr((mean - value) / sigma)
    best = np.argsort(log_weight)[-20_000:]
    weight = np.exp(log_weight[best] - log_weight[best].max())
    chosen = rng.choice(best, 4_000, p=weight / weight.sum())
    at = np.linspace(-2.0, 2.0, 2_001)
    drawn = (np.exp(-0.5 * ((at[:, None] - mean[chosen]) / sigma[chosen]) ** 2) / sigma[chosen]).mean(axis=1)
    stated = np.exp(ended_lives._predictive(values, variance, exact, VAGUE, (shape, rate)).log_density(at))
    expected, found = (weighted_quantiles(at, each / each.sum(), (0.05, 0.5, 0.95)) for each in (drawn, stated))
    assert np.exp(found) == pytest.approx(np.exp(expected), rel=0.02)


def test_the_exponent_of_severity_is_that_of_a_line_through_logarithms() -> None:
    work = np.array([1.0, 2.0, 4.0, 7.0])
    ends = 1e4 * work**-1.5 * np.exp([0.1, -0.2, 0.05, 0.1])
    line = linregress(np.log(work), np.log(ends))
    assert severity_exponent(ends, work) == pytest.approx((-line.slope, line.stderr))
    for too_little in ((ends[:2], work[:2]), (ends, np.ones(4))):
        with pytest.raises(ValueError, match="lives under different work are needed, 3 or more"):
            severity_exponent(*too_little)


def test_a_life_that_was_taken_out_says_that_its_end_was_later() -> None:
    """Not that it was then; and one that was taken out early says next to nothing."""
    tests, known = measured(1_300.0, 0.3), lives()[:6]
    out = [replace(life, end=1_400.0, censored=True) for life in known[:3]]
    without, with_these = quantiles(said(tests, known)), quantiles(said(tests, known + out))
    assert with_these[1] > without[1]
    early = quantiles(said(tests, known + [replace(life, end=200.0) for life in out]))
    assert early == pytest.approx(without, rel=0.02)


def accelerating(until: float) -> list[Measurement]:
    """Mean COF that passes half of its 0.1 at ζ = 1000, ever faster, at 25 even tests of that life up to `until`."""
    at = np.arange(0.0, until + 1e-9, 40.0)
    return sent(at, 0.1 - 0.05 * (at / 1_000.0) ** 2, 1e-8)


@pytest.mark.parametrize("stopped", [960.0, 880.0])
def test_a_life_that_is_declared_worn_before_its_threshold_ends_near_it(stopped: float) -> None:
    end, deviation = declared_end(accelerating(stopped), stopped, fraction=0.5, horizon=1e6)
    assert stopped < end < 1_060.0
    assert abs(math.log(end / 1_000.0)) < 3.0 * deviation + 0.01
    assert deviation < 0.06


def test_a_life_without_wear_that_is_declared_worn_ended_then() -> None:
    """Nothing in its tests says so, so its end is uncertain, and not ten times as late."""
    level = sent(np.arange(0.0, 1_000.0, 50.0), 0.1, 1e-8)
    end, deviation = declared_end(level, 1_000.0, fraction=0.5, horizon=1e6)
    assert 1_000.0 <= end < 1_500.0
    assert 0.0 < deviation < 0.5
