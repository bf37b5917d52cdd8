"""Courses and their knees, the model's discrepancy, both as one linear model, priors and draws."""

import math
from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from models.arrays import FloatArray
from models.degradation.general_order import first_passage, progress_fraction
from models.prognosis.first_passage import ends_of_life, predict_first_passage, weighted_quantiles
from models.tracking import courses, linear_model, sampling
from models.tracking.courses import CourseForm
from models.tracking.criteria import KNEE_HAZARD, KNEE_REACH, UNSEEN_WEAR
from models.tracking.discrepancy import PAST, drawn_discrepancy, smooth
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior, weak
from tests import dense
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    NAMES,
    PRIOR,
    TYPICAL,
    beside,
    draws_of,
    followed,
    on_grid,
    sent,
    series,
)

# --- Courses: their coordinates and their prior probabilities.


@pytest.mark.parametrize("course", list(CourseForm))
def test_basis_is_the_share_of_the_change_and_coordinates_lead_back(course: CourseForm) -> None:
    log_scale, log_exponent, kind = np.array([9.2]), np.array([-0.4]), np.array([course])
    scale, exponent = courses.coefficients_at(log_scale, log_exponent, kind)
    zeta = np.array([[0.0], [100.0], [9_000.0]])
    expected = progress_fraction(zeta, scale, exponent)
    found = courses.basis(zeta, log_scale, log_exponent, kind) * courses.UNIT_OF_CHANGE[kind]
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert courses.course_of(scale, exponent) == [course]
    back = courses.coordinates_of(scale, exponent, kind)
    assert back[0] == pytest.approx(log_scale)
    assert back[1] == pytest.approx(0.0 if courses.WITHOUT_EXPONENT[course] else log_exponent)


@pytest.mark.parametrize(
    ("course", "expected"),
    [(CourseForm.EXPONENTIAL, lambda x: -np.expm1(-x)), (CourseForm.LOGARITHM, np.log1p)],
    ids=["exponential", "logarithm"],
)
def test_courses_without_an_exponent_are_what_they_are_called(course: CourseForm, expected: Any) -> None:
    zeta = np.linspace(0.0, 30_000.0, 50)
    found = courses.basis(zeta[:, None], np.array([math.log(5_000.0)]), np.zeros(1), np.array([course]))
    np.testing.assert_allclose(found[:, 0], expected(zeta / 5_000.0), atol=1e-3)


def test_forms_are_courses_by_sizes_and_ends_lie_beyond_what_was_measured() -> None:
    weight = np.exp(courses.log_form_weight(PRIOR))
    assert weight.sum() == pytest.approx(1.0)
    assert weight[courses.FORM_COURSE == CourseForm.EQ_6].sum() == pytest.approx(PRIOR.eq_6_share)
    np.testing.assert_array_equal(
        courses.form_of(courses.FORM_COURSE, courses.FORM_SIZE, courses.FORM_PROPORTIONAL),
        np.arange(courses.FORM_SIZE.size),
    )
    sure = courses.log_form_weight(replace(PRIOR, eq_6_share=1.0))
    assert np.isneginf(sure[courses.FORM_COURSE != CourseForm.EQ_6]).all()
    # a course that ends does so beyond what was measured
    course, place = np.array([CourseForm.EQ_6, CourseForm.ENDING, CourseForm.HYPERBOLIC]), np.full(3, math.log(100.0))
    log_scale, stretch = courses.log_scale_at(place, course, 7_000.0)
    np.testing.assert_allclose(np.exp(log_scale), [100.0, 7_100.0, 7_100.0])
    np.testing.assert_allclose(courses.place_of(log_scale, course, 7_000.0), place)
    near = courses.log_scale_at(place + 1e-6, course, 7_000.0)[0]
    np.testing.assert_allclose(stretch, np.log((near - log_scale) / 1e-6), atol=1e-5)


# --- The discrepancy beside eq. 6: its size, lives of another law, and steps at events.


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
    course = beside(
        50,
        span=7_000.0,
        size=np.full(50, 0.1),
        curvature=rng.standard_normal((50, 22)),
        at=np.array([4_000.5]),
        height=rng.standard_normal((50, 1)),
    )
    own = np.repeat(progress[:, None], 50, axis=1)
    np.testing.assert_allclose(course.measured(progress), course(own, progress[:, None]), rtol=0, atol=1e-13)
    assert np.abs(course.measured(progress) - replace(course, height=-course.height).measured(progress)).max() > 1.0


def test_a_straight_line_is_no_eq_6_and_the_data_say_so() -> None:
    """COF falls on a line to 40 % of its loss, where eq. 6 would bend: the end of life is held, and is not by filters
    that are sure of eq. 6."""
    progress = np.linspace(0.0, 6_000.0, 20)
    rng = np.random.default_rng(4)
    values = 0.1 * (1.0 - 5e-5 * progress) * (1.0 + 0.002 * rng.standard_normal(20))
    line = sent(progress, values, 1e-9)
    prior = weak(line[0], falling=True)
    for tracker in (Grid(), Particle(), Ukf()):
        posterior = tracker.posterior(followed(tracker, prior, line), 1_000, np.random.default_rng(2))  # type: ignore[arg-type]
        found = predict_first_passage(posterior, fraction=0.5, as_of=6_000.0).end_of_life
        assert found[0.05] < 10_000.0 < (found[0.95] or math.inf)
    sure = on_grid(line, 1_000, np.random.default_rng(2), replace(prior, law_share=1.0, eq_6_share=1.0))
    told = predict_first_passage(sure, fraction=0.5, as_of=6_000.0)
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
        return (ends[0.95] or 1e6) - ends[0.05]

    assert width(after[:13]) > 1.5 * width(before[:13])
    assert width(after) < 0.5 * width(after[:13])
    posterior = tracker.posterior(followed(tracker, PRIOR, after), 2_000, np.random.default_rng(1))
    step = posterior.moments(posterior.discrepancy.height.sum(axis=1))
    assert step[0] == pytest.approx(0.06 * 0.134, abs=3.0 * step[1])
    assert step[1] < 0.3 * 0.06 * 0.134


@pytest.mark.parametrize("tracker", [Grid(), Particle(), Ukf()], ids=NAMES)
@pytest.mark.parametrize(("step", "last", "left"), [(0.02, 19_000.0, 1_000.0), (-0.02, 15_000.0, 5_000.0)])
def test_a_zeroed_sensor_changes_the_readings_and_not_the_clutch(
    tracker: Any, step: float, last: float, left: float
) -> None:
    """COF falls evenly to half at 20,000; from 7,500 on readings are off by a fifth. As an oil change the same step moves
    the clutch: of the readings the end is too late or reached."""
    at = np.arange(0.0, last + 1.0, 1_000.0)
    values = 0.1 * (1.0 - 0.5 * at / 20_000.0) * (1.0 + 0.002 * np.random.default_rng(2).standard_normal(at.size))
    after = at > 7_500.0
    tests = sent(at, values + step * after, 1e-9, after)
    zeroed = [replace(test, sensor=test.epoch) for test in tests]

    def median(measurements: list[Measurement]) -> float:
        state = followed(tracker, weak(measurements[0], falling=True), measurements)
        posterior = tracker.posterior(state, 1_000, np.random.default_rng(1))
        return predict_first_passage(posterior, fraction=0.5, as_of=last).end_of_life[0.5] - last

    assert median(zeroed) == pytest.approx(left, rel=0.25)
    assert median(tests) != pytest.approx(left, rel=0.25)


def test_a_course_goes_on_along_its_knee_from_there_on() -> None:
    """From ζ = 1,500 on by four times the mean pace of wear until then, and a tenth of ξ0 counts as worn; before, nothing
    changes. One that rises stays from there on and falls by that tenth alone."""
    course = beside(2, size=np.full(2, 0.01), knee=np.array([1_500.0, np.inf]), steepening=np.full(2, 4.0))
    line = draws_of(2, initial=0.1, change=-0.1, scale=-10_000.0, exponent=-1.0, discrepancy=course)
    at = np.array([0.0, 1_000.0, 1_500.0, 2_000.0])
    fallen = 4.0 * (0.015 + UNSEEN_WEAR * 0.1) / 1_500.0 * 500.0
    np.testing.assert_allclose(
        line.values(at).T, [[0.1, 0.09, 0.085, 0.08 - fallen], [0.1, 0.09, 0.085, 0.08]], atol=1e-12
    )
    assert ends_of_life(line, 0.5) == pytest.approx([1_500.0 + 0.035 / (1e-5 + fallen / 500.0), 5_000.0], rel=2e-3)
    rising = draws_of(2, initial=0.1, change=0.1, scale=-10_000.0, exponent=-1.0, discrepancy=course)
    fallen = 4.0 * UNSEEN_WEAR * 0.1 / 1_500.0 * 500.0
    np.testing.assert_allclose(rising.values(at)[-1], [0.115 - fallen, 0.12], atol=1e-12)


def test_knees_come_as_their_hazard_has_it_and_eq_6_alone_has_none_once_it_wears() -> None:
    prior = weak(Measurement(progress=0.0, value=0.1, variance=0.0), falling=True)
    history = History.of(sent([0.0, 2_000.0], 0.1), prior)
    sizes, worn = np.repeat([0.0, 0.0, 0.03], 20_000), np.repeat([0.2, 0.05, 0.2], 20_000)

    def knees(history: History, prior: TrackPrior) -> FloatArray:
        return drawn_discrepancy(
            history, prior, sizes, np.zeros((sizes.size, PAST)), worn, np.random.default_rng(4)
        ).knee

    found = knees(history, prior)
    assert np.isinf(found[:20_000]).all()
    for ahead in (1.5, 3.0, 30.0):
        for some, reach in ((found[20_000:40_000], KNEE_REACH), (found[40_000:], np.inf)):
            expected = 1.0 - min(ahead, reach) ** -KNEE_HAZARD
            assert (some <= ahead * 2_000.0).mean() == pytest.approx(expected, abs=0.015)
    assert found.min() >= 2_000.0
    # before a second test there is no scale that they could have
    assert np.isinf(knees(History.of(sent([0.0], 0.1), prior), prior)).all()
    parameter = weak(Measurement(progress=0.0, value=0.1, variance=0.0), falling=False)
    assert np.isinf(knees(history, parameter)).all()


def test_the_first_signs_of_a_knee_move_the_answer_within_two_tests() -> None:
    """An even course that goes six times as fast from 7,000 cycles on and ends at 10,000, a test every 400."""
    rng = np.random.default_rng(1)
    at = np.arange(0.0, 8_000.1, 400.0)
    share = np.where(at < 7_000.0, 0.4e-4 * at, 0.28 + 2.4e-4 * (at - 7_000.0))
    values = 0.1 * (1.0 - 0.5 * share) * (1.0 + 0.003 * rng.standard_normal(at.size))
    tests = sent(at, values, 1e-9)
    said = []
    for count in (18, 20):
        posterior = on_grid(tests[:count], 1_000, rng)
        said.append(weighted_quantiles(np.minimum(ends_of_life(posterior, 0.5), 1e6), posterior.weight, (0.05, 0.5)))
    (_, before), (low, after) = said
    assert before > 15_000.0
    assert low < 10_000.0
    assert after < 12_000.0


# --- The closed form of ξ0, Δ and the further terms, against the whole normal distribution of the data.

#: Without noise.
EVEN = series(TYPICAL, np.linspace(0.0, 12_000.0, 13), 0.0)
BELIEF = weak(EVEN[0], falling=True)
#: Three of eq. 6, with q of 0, 0.03 and 0.1, and one of every other course; of two the scatter is a share of the value.
POINTS = linear_model.EvaluationPoints(
    log_scale=np.array([8.5, 7.0, 10.0, 9.6, 8.0, 9.9, 8.5, 7.5]),
    log_exponent=np.array([-0.3, 0.4, -1.0, -0.7, 0.5, 0.1, 0.0, 0.0]),
    log_scatter=np.array([-8.0, -6.5, -9.0, -8.0, -7.5, -8.5, -8.0, -8.0]),
    form=np.array([0, 2, 3, 5, 10 + 24, 12, 19 + 24, 21]),
    outlying=np.eye(13)[:, [4, 4, 12, 4, 5, 4, 3, 6]] * [0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0],
)
COUNT = POINTS.form.size
#: An event comes before the fifth run from the end, and the last three have a new level.
EPOCHS = [
    replace(each, epoch=int(index > 7) + int(index > 9), new_levels=int(index > 9)) for index, each in enumerate(EVEN)
]


def normal(point: int, measurements: list[Measurement]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the measurements at one of POINTS, all linear terms integrated out."""
    means, covariances = dense.normal(BELIEF, measurements, POINTS)
    return means[point], covariances[point]


@pytest.mark.parametrize("measurements", [EVEN, EPOCHS], ids=["one epoch", "three epochs"])
def test_evidence_is_that_of_the_whole_normal_also_with_the_last_run_turned_outlying(
    measurements: list[Measurement],
) -> None:
    """All linear terms integrated out, the data are normal; δ's covariance comes from quadrature here."""
    history = History.of(measurements, BELIEF)
    found = linear_model.evidence(linear_model.pointwise(history, BELIEF, POINTS)[0], BELIEF)
    for point, log_probability in enumerate(found):
        mean, covariance = normal(point, measurements)
        expected = multivariate_normal(mean, covariance).logpdf(history.value)
        assert log_probability == pytest.approx(expected, abs=2e-3)
    # With one epoch the first point has no further terms, with three all have.
    sound = replace(POINTS, outlying=POINTS.outlying * (np.arange(13) < 12)[:, None])
    outlying = replace(sound, outlying=sound.outlying + (np.arange(13) == 12)[:, None])
    sums, terms = linear_model.pointwise(history, BELIEF, sound)
    last = courses.basis(history.progress[-1], POINTS.log_scale, POINTS.log_exponent, POINTS.course)
    turned = linear_model.last_outlying(history, BELIEF, sound, sums, terms, last)
    anew = linear_model.pointwise(history, BELIEF, outlying)[0]
    for name, found in asdict(turned).items():
        np.testing.assert_allclose(found, getattr(anew, name), rtol=1e-9, err_msg=name)


def test_the_drawn_pair_is_that_of_the_whole_normal() -> None:
    """(ξ0, Δ) and the data are jointly normal: condition on the data. Normals of 0 and 1 draw the mean and a root."""
    history = History.of(EPOCHS, BELIEF)
    sums = linear_model.pointwise(history, BELIEF, POINTS)[0]
    units = [np.tile(unit, (COUNT, 1)) for unit in ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0])]
    middle, *ends = (np.stack(linear_model.drawn_pair(sums, BELIEF, unit)) for unit in units)
    for point in range(COUNT):
        mean, covariance = normal(point, EPOCHS)
        b = (mean - BELIEF.initial_mean) / BELIEF.change_mean
        prior = np.diag([BELIEF.initial_sd**2, BELIEF.change_sd**2])
        cross = prior @ np.stack([np.ones_like(b), b])
        gain = np.linalg.solve(covariance, cross.T).T
        expected = np.array([BELIEF.initial_mean, BELIEF.change_mean]) + gain @ (history.value - mean)
        spread = prior - gain @ cross.T
        np.testing.assert_allclose(middle[:, point], expected, rtol=1e-4)
        root = np.stack([(end - middle)[:, point] for end in ends], axis=1)
        np.testing.assert_allclose(root @ root.T, spread, rtol=2e-3)


def test_the_table_and_the_points_are_one_sum() -> None:
    history = History.of(EPOCHS, BELIEF)
    table = courses.basis(history.progress[:, None], POINTS.log_scale, POINTS.log_exponent, POINTS.course)
    levels = np.array([-8.0, -7.0])
    forms, outlying = np.array([0, 2 + 24]), np.eye(13)[:, [0, 5]]
    tabled = linear_model.evidence(
        linear_model.tabulated(history, BELIEF, table, np.stack([levels, levels]), forms, outlying), BELIEF
    )
    for kind, level in np.ndindex(2, 2):
        points = replace(
            POINTS,
            log_scatter=np.full(COUNT, levels[level]),
            form=np.full(COUNT, forms[kind]),
            outlying=np.repeat(outlying[:, kind : kind + 1], COUNT, axis=1),
        )
        pointed = linear_model.evidence(linear_model.pointwise(history, BELIEF, points, table)[0], BELIEF)
        np.testing.assert_allclose(tabled[kind, level], pointed, rtol=1e-9)


def test_drawn_terms_have_the_posterior_of_the_discrepancy() -> None:
    """Mean and variance of δ at the last run given the data, from 20,000 draws, against conditioning the joint normal."""
    history = History.of(EVEN, BELIEF)
    count = 20_000
    points = linear_model.EvaluationPoints(
        log_scale=np.full(count, 7.0),
        log_exponent=np.full(count, 0.4),
        log_scatter=np.full(count, -6.5),
        form=np.full(count, 2),
        outlying=np.repeat(POINTS.outlying[:, 1:2], count, axis=1),
    )
    sums, terms = linear_model.pointwise(history, BELIEF, points)
    rng = np.random.default_rng(0)
    initial, change = linear_model.drawn_pair(sums, BELIEF, rng.standard_normal((count, 2)))
    drawn = linear_model.drawn_terms(terms, initial - BELIEF.initial_mean, change, rng.standard_normal((count, 6)))
    at_the_last = drawn @ smooth(history.progress, history.span, 6)[-1]
    mean, covariance = normal(1, EVEN)
    cross = (0.03 * 0.134) ** 2 * dense.integrated(history.progress)[-1]
    gain = np.linalg.solve(covariance, cross)
    sd = math.sqrt((0.03 * 0.134) ** 2 * dense.integrated(history.progress)[-1, -1] - gain @ cross)
    assert at_the_last.mean() == pytest.approx(gain @ (history.value - mean), abs=4.0 * sd / math.sqrt(count))
    assert at_the_last.std() == pytest.approx(sd, rel=0.03)


# --- Priors, measurements and histories check themselves; draws are even.


def test_a_prior_survives_its_array_and_checks_itself() -> None:
    assert TrackPrior.from_array(PRIOR.to_array()) == PRIOR
    with pytest.raises(ValueError, match="change_sd must be positive"):
        replace(PRIOR, change_sd=0.0)
    with pytest.raises(ValueError, match="initial_mean must be finite"):
        replace(PRIOR, initial_mean=math.nan)
    with pytest.raises(ValueError, match="outlying_share must lie within"):
        replace(PRIOR, outlying_share=1.0)
    with pytest.raises(ValueError, match="law_share must lie within"):
        replace(PRIOR, law_share=0.0)


def test_the_weak_prior_scales_with_the_quantity() -> None:
    """The same clutch in another unit has the same life."""
    big = [replace(m, value=1e3 * m.value, variance=1e6 * m.variance) for m in CAMPAIGN]
    lives = []
    for measurements in (CAMPAIGN, big):
        drawn = on_grid(measurements, 500, np.random.default_rng(3))
        passage = predict_first_passage(drawn, fraction=0.5, as_of=0.0)
        lives.append(passage.end_of_life[0.5])
    assert lives[0] == pytest.approx(lives[1], rel=1e-6)


@pytest.mark.parametrize("life", [1e2, 1e4, 1e6])
def test_lives_of_any_length_are_tractable(life: float) -> None:
    """Measured to 90 % of its life, the end is found within 10 %, whatever the length of the life."""
    d = replace(TYPICAL, scale=life / 7.4)
    seen = series(d, np.linspace(0.0, 0.9, 30) * life, 2e-4)
    drawn = on_grid(seen, 1_000, np.random.default_rng(3), PRIOR)
    passage = predict_first_passage(drawn, fraction=0.5, as_of=0.9 * life, horizon=1e7)
    assert passage.end_of_life[0.5] == pytest.approx(float(first_passage(0.067, d)), rel=0.1)


@pytest.mark.parametrize("numbers", [(-1.0, 0.1, 0.0), (0.0, math.nan, 0.0), (0.0, 0.1, -1e-9), (math.inf, 0.1, 0.0)])
def test_measurements_check_themselves(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        Measurement(progress=numbers[0], value=numbers[1], variance=numbers[2])


def test_draws_share_out_weights_and_are_even() -> None:
    weight = np.array([0.5, 0.0, 0.3, 0.2])
    for offset in (0.0, 0.5, 0.999):
        assert np.bincount(sampling.systematic(weight, 10, offset), minlength=4).tolist() == [5, 0, 3, 2]
    # The share of 200 corners of the cube: these points err by less than half of what independent ones do.
    rng = np.random.default_rng(0)
    edges = rng.random((200, 3))
    points = sampling.spread_points(1_000, np.full(3, 0.5))
    assert points.min() > 0.0
    assert points.max() < 1.0

    def error(sample: np.ndarray) -> float:
        shares = (sample[None] < edges[:, None]).all(axis=2).mean(axis=1)
        return float(np.sqrt(np.mean((shares - edges.prod(axis=1)) ** 2)))

    assert error(points) < 0.5 * error(rng.random((1_000, 3)))


def test_a_long_history_is_summed_by_blocks_as_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The witness is the plain sum over all tests; a point's sums are the same to the last bit whatever is beside it."""
    rng, tests, count = np.random.default_rng(3), 300, 200
    progress = rng.permutation(np.linspace(0.0, 5e4, tests))
    values = 0.134 - 0.05 * progress / 5e4 + 4e-4 * rng.standard_normal(tests)
    measurements = sent(progress, values, 1e-8 * rng.uniform(0.5, 2.0, tests), np.floor(progress / 2e4))
    history = History.of(measurements, BELIEF)
    points = linear_model.EvaluationPoints(
        log_scale=rng.normal(11.5, 0.5, count),
        log_exponent=rng.normal(-0.3, 0.3, count),
        log_scatter=rng.normal(np.log(4e-4), 0.3, count),
        form=np.arange(count) % courses.FORM_COURSE.size,
        outlying=(rng.random((tests, count)) < 0.02).astype(float),
    )

    def taken(index: np.ndarray) -> linear_model.EvaluationPoints:
        columns = {name: getattr(points, name)[index] for name in ("log_scale", "log_exponent", "log_scatter", "form")}
        return linear_model.EvaluationPoints(outlying=points.outlying[:, index], **columns)

    sums, terms = linear_model.pointwise(history, BELIEF, points)
    some = rng.permutation(count)[:77]
    alone, _ = linear_model.pointwise(history, BELIEF, taken(some))
    again, _ = linear_model.solved_at((sums, terms), some)
    for field in fields(linear_model.Sums):
        np.testing.assert_array_equal(getattr(alone, field.name), getattr(sums, field.name)[some])
        np.testing.assert_array_equal(getattr(again, field.name), getattr(alone, field.name))
    monkeypatch.setattr(linear_model, "WHOLE", tests)
    plain, plain_terms = linear_model.pointwise(history, BELIEF, points)
    # log probabilities are differences of sums weighted by up to 1e8
    at_once = linear_model.evidence(plain, BELIEF)
    np.testing.assert_allclose(linear_model.evidence(sums, BELIEF), at_once, rtol=1e-8, atol=1e-4)
    np.testing.assert_array_equal(terms.where, plain_terms.where)


def test_kinds_that_share_a_table_have_the_sums_of_their_own() -> None:
    history = History.of(EPOCHS, BELIEF)
    forms = np.flatnonzero(~courses.FORM_PROPORTIONAL)[[0, 1, 3, -1, -2]]
    own = courses.FORM_COURSE[forms]
    tables = courses.basis(
        history.progress[:, None], POINTS.log_scale, POINTS.log_exponent, np.array(courses.CourseForm)[:, None, None]
    )
    levels, outlying = np.tile([-8.0, -7.0], (forms.size, 1)), np.repeat(np.eye(13)[:, [5]], forms.size, axis=1)
    sent = {"log_scatter": levels, "form": forms, "outlying": outlying, "blur": 0.01}
    shared = linear_model.tabulated(history, BELIEF, tables, **sent, of=own)
    apart = linear_model.tabulated(history, BELIEF, tables[own], **sent)
    for name, found in asdict(shared).items():
        np.testing.assert_allclose(found, getattr(apart, name), rtol=1e-9, err_msg=name)
