"""Each filter against others, closed forms and dense grids."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from scipy.integrate import trapezoid

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction, value
from models.prognosis.first_passage import PassageStatus, predict_first_passage, weighted_quantiles
from models.tracking import linear_model
from models.tracking.courses import (
    FORM_COURSE,
    FORM_PROPORTIONAL,
    FORM_SIZE,
    SCALE_SIGN,
    WITHOUT_EXPONENT,
    log_form_weight,
)
from models.tracking.criteria import COURSE_SHARES, EQ_6_SHARE, KNEE_HAZARD, PROPORTIONAL_SHARE
from models.tracking.discrepancy import PAST, value_and_slope
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import DOMAIN, Normals, Ukf, _taken_in, before_last, scaled, unscaled
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from models.tracking.sampling import with_linear_terms
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    COLUMNS,
    FILTERS,
    NAMES,
    PLAIN,
    PRIOR,
    TYPICAL,
    WEIRD,
    followed,
    on_grid,
    same,
    sent,
    series,
)

EACH = pytest.mark.parametrize("tracker", FILTERS, ids=NAMES)

# --- What each of the three filters must do on any series, and where they must agree. Large comparisons:
# tests/statistical.


@EACH
@pytest.mark.parametrize("falling", [True, False])
@pytest.mark.parametrize("case", WEIRD)
def test_any_series_leaves_finite_numbers(tracker: Any, falling: bool, case: str) -> None:
    measurements = WEIRD[case]
    prior = weak(measurements[0], falling=falling)
    state = followed(tracker, prior, measurements)
    posterior = tracker.posterior(state, 400, np.random.default_rng(1))
    for name in COLUMNS:
        column = getattr(posterior, name)
        assert column.shape == (400,)
        assert np.isfinite(column).all(), name
    assert np.isfinite(posterior.values(np.array([0.0, 1e3, 1e6]))).all()
    assert posterior.weight.sum() == pytest.approx(1.0)
    assert min(np.abs(posterior.scale).min(), np.abs(posterior.exponent).min(), posterior.scatter.min()) > 0.0
    predict_first_passage(posterior, fraction=0.5, as_of=measurements[-1].progress)


@EACH
def test_a_seed_gives_the_same_answer_twice_from_stored_arrays_too(tracker: Any) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN[:7], seed=5)
    arrays = state.to_arrays()
    assert arrays.keys() == STORED_NAMES[tracker.name]
    # in the order of the fields of TrackPrior, of which 0.05 is the share of outlying runs and 0.1 their size
    assert arrays["prior"].tolist()[10:] == [0.05, 0.1, 0.95, 0.05, EQ_6_SHARE, PROPORTIONAL_SHARE, KNEE_HAZARD]
    flags = [] if tracker.name == "grid" else ["outlying"]
    assert [name for name, column in arrays.items() if column.dtype == np.bool_] == flags
    assert all(column.dtype == np.float64 for name, column in arrays.items() if name not in flags)
    before, again = (
        type(state).from_arrays({name: column.copy() for name, column in reversed(arrays.items())}) for _ in range(2)
    )
    assert list(again.to_arrays()) == list(arrays)
    assert same(state, again)
    steps = [tracker.update(s, CAMPAIGN[7], np.random.default_rng(9)) for s in (state, again)]
    assert same(*steps)
    assert same(state, before)  # an update leaves the old state alone
    draws = [tracker.posterior(step, 500, np.random.default_rng(2)) for step in steps]
    assert all(np.array_equal(getattr(draws[0], n), getattr(draws[1], n)) for n in COLUMNS)
    places = np.array([0.0, 6e3, 5e4])
    assert np.array_equal(draws[0].values(places), draws[1].values(places))


def test_particle_and_grid_agree_on_the_coefficients() -> None:
    """Means within 0.2 deviations: 2,000 particles that count as 500 leave 0.045; four times that is allowed."""
    posteriors = [
        tracker.posterior(followed(tracker, PRIOR, CAMPAIGN), 2_000, np.random.default_rng(1))
        for tracker in (Particle(), Grid())
    ]
    for name in ("initial", "change", "scale", "exponent", "scatter"):
        (particle, _), (grid, sd) = (p.moments(np.log(np.abs(getattr(p, name)))) for p in posteriors)
        assert abs(particle - grid) < 0.2 * sd, name


SERIES = {"prior", "progress", "value", "variance", "epoch", "new_levels", "sensor"}
PARTICLES = SERIES | {"points", "form", "outlying", "log_weight", "log_target"}
STORED_NAMES = {
    "grid": SERIES,
    "particle": PARTICLES,
    "ukf": PARTICLES | {f"normal_{name}" for name in ("reference", "form", "weight", "mean", "covariance")},
}


# --- The grid against plain quadrature, the prior and itself.


def test_a_whole_history_at_once_is_what_updates_fold_to_in_any_order() -> None:
    grid = Grid(nodes=13, rows=13, levels=7)
    whole = grid.from_history(PRIOR, CAMPAIGN)
    assert same(whole, followed(grid, PRIOR, CAMPAIGN))
    assert not same(whole, grid.from_history(PRIOR, CAMPAIGN[::-1]))
    # Only the order of sums differs.
    grid = Grid()
    there, back = (grid.laid(grid.from_history(PRIOR, each)).mass for each in (CAMPAIGN, CAMPAIGN[::-1]))
    np.testing.assert_allclose(there, back, atol=1e-9)


def test_the_grid_without_data_is_the_prior() -> None:
    """Draws from four deviations of the prior: its means and deviations to within the 0.1 % cut off and the draws."""
    drawn = Grid().posterior(Grid().start(PRIOR), 4_000, np.random.default_rng(0))
    share = np.bincount(drawn.course, weights=drawn.weight)
    np.testing.assert_allclose(share, [EQ_6_SHARE, *(1.0 - EQ_6_SHARE) * COURSE_SHARES], atol=0.01)
    kept = np.flatnonzero(~WITHOUT_EXPONENT[drawn.course])
    posterior = drawn.taken(kept, drawn.weight[kept] / drawn.weight[kept].sum())
    for sample, mean, sd in (
        (posterior.initial, PRIOR.initial_mean, PRIOR.initial_sd),
        (posterior.change, PRIOR.change_mean, PRIOR.change_sd),
        (posterior.log_scale, PRIOR.log_scale_mean, PRIOR.log_scale_sd),
        (posterior.log_exponent, PRIOR.log_exponent_mean, PRIOR.log_exponent_sd),
        (np.log(posterior.scatter), PRIOR.log_scatter_mean, PRIOR.log_scatter_sd),
    ):
        found = posterior.moments(sample)
        assert found[0] == pytest.approx(mean, abs=0.05 * sd)
        assert found[1] == pytest.approx(sd, rel=0.05)


def test_every_draw_carries_its_exact_density() -> None:
    """Log weights of grid draws differ from the log posterior by the draws' own density: no draw is far out of line."""
    long = series(TYPICAL, np.linspace(0.0, 15_000.0, 40), 4e-4)
    posterior = on_grid(long, 2_000, np.random.default_rng(0), PRIOR)
    assert 1.0 / np.square(posterior.weight).sum() > 0.4 * 2_000


def test_the_marginal_of_log_scale_against_plain_quadrature() -> None:
    """ε and s held nearly fixed by their prior, the posterior of log φ is a one-dimensional integral."""
    prior = replace(PLAIN, log_exponent_sd=1e-3, log_scatter_sd=1e-3, log_exponent_mean=-0.36, log_scatter_mean=-7.8)
    log_scale = np.linspace(7.5, 9.5, 4_001)
    history = History.of(CAMPAIGN, prior)
    points = linear_model.EvaluationPoints(
        log_scale=log_scale,
        log_exponent=np.full(4_001, -0.36),
        log_scatter=np.full(4_001, -7.8),
        form=np.zeros(4_001, dtype=np.intp),
        outlying=np.zeros((len(CAMPAIGN), 4_001)),
    )
    sums, _ = linear_model.pointwise(history, prior, points)
    density = linear_model.evidence(sums, prior) - 0.5 * ((log_scale - prior.log_scale_mean) / prior.log_scale_sd) ** 2
    density = np.exp(density - density.max())
    density /= trapezoid(density, log_scale)
    mean = trapezoid(density * log_scale, log_scale)
    sd = math.sqrt(trapezoid(density * (log_scale - mean) ** 2, log_scale))
    posterior = on_grid(CAMPAIGN, 4_000, np.random.default_rng(0), prior)
    found = posterior.moments(np.log(posterior.scale))
    assert found[0] == pytest.approx(mean, abs=0.05 * sd)
    assert found[1] == pytest.approx(sd, rel=0.05)


# --- The particles stay apart, and a measurement counts once however it is introduced.


def test_particles_stay_apart_because_they_move() -> None:
    measurements = series(TYPICAL, np.linspace(0.0, 12_000.0, 25), 4e-4)
    distinct = {
        moves: np.unique(
            followed(Particle(particles=400, moves=moves), PRIOR, measurements).cloud.points, axis=0
        ).shape[0]
        for moves in (0, 8)
    }
    assert distinct[8] > 0.9 * 400
    assert distinct[0] < 0.2 * 400


def test_a_starving_measurement_counts_once() -> None:
    """After starving measurements every particle's target is that of the whole history, taken at once."""
    state = followed(Particle(particles=200), PRIOR, sent([0.0, 1e3, 7e3, 15e3], [0.13, 0.115, 0.085, 0.068]))
    placed = state.cloud.placed()
    target = linear_model.evidence(linear_model.pointwise(state.history, PRIOR, placed)[0], PRIOR)
    target += PRIOR.log_density(*state.cloud.points.T) + linear_model.log_outlying(PRIOR, placed.outlying)
    target += log_form_weight(PRIOR)[state.cloud.form.astype(int)]
    np.testing.assert_allclose(state.cloud.log_target, target, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("low", [2, 3, 5])
@pytest.mark.parametrize("tracker", [Particle(), Ukf()])
def test_friction_that_has_fallen_at_once_is_followed_from_the_second_test_on(tracker, low: int) -> None:
    """Eight tests of a level, and some at 60 % of it: one may be outlying, two are the present, which goes no lower."""
    level = np.array([0.13] * 8 + [0.078] * low) * (1.0 + 0.003 * np.random.default_rng(1).standard_normal(8 + low))
    history = sent(1_000.0 * np.arange(8 + low), level)
    exact = on_grid(history, 1_000, np.random.default_rng(1))
    state = followed(tracker, weak(history[0], falling=True), history)
    sample = tracker.posterior(state, 1_000, np.random.default_rng(1))
    here = np.array([history[-1].progress])
    medians = [weighted_quantiles(draws.values(here)[0], draws.weight, (0.05, 0.5, 0.95)) for draws in (exact, sample)]
    np.testing.assert_allclose(medians[1], medians[0], atol=0.005)
    assert medians[1][1] == pytest.approx(0.078, abs=0.002)


# --- The unscented filter: one step of filterpy from the particles before a test.


def test_the_ukf_leaves_the_particles_alone_and_carries_nothing() -> None:
    """The particles beside it are those of the particle filter, bit for bit, and a step asks for no earlier normals."""
    ukf, state = Ukf(), followed(Ukf(), PRIOR, CAMPAIGN[:8])
    assert same(state.particles, followed(Particle(), PRIOR, CAMPAIGN[:8]))
    assert state.normals.form.size > 0
    steps = [
        ukf.update(each, CAMPAIGN[8], np.random.default_rng(3))
        for each in (state, ukf.passed(followed(ukf, PRIOR, CAMPAIGN[:7]), CAMPAIGN[7], np.random.default_rng(2)))
    ]
    for each in steps:
        assert each.normals.form.size > 0
    without = ukf.update(replace(state, normals=Normals.none()), CAMPAIGN[8], np.random.default_rng(3))
    assert same(steps[0], without)
    assert not same(*steps)


@pytest.mark.parametrize("count", [0, 1, 4])
def test_before_there_is_anything_to_step_from_the_answer_of_the_ukf_is_the_particles(count: int) -> None:
    state = followed(Ukf(), PRIOR, CAMPAIGN[:count])
    assert state.normals.form.size == 0
    draws = [
        tracker.posterior(of, 500, np.random.default_rng(0))
        for tracker, of in ((Ukf(), state), (Particle(), state.particles))
    ]
    assert all(np.array_equal(getattr(draws[0], name), getattr(draws[1], name)) for name in COLUMNS)
    assert followed(Ukf(), PRIOR, CAMPAIGN[:5]).normals.form.size > 0


def test_the_ukf_stays_in_its_domain_and_definite() -> None:
    stepped_on = 0
    for measurements in WEIRD.values():
        normals = followed(Ukf(), weak(measurements[0], falling=True), measurements).normals
        stepped_on += normals.form.size > 0
        assert np.abs(normals.mean).max(initial=0.0) <= 6.0
        np.testing.assert_array_equal(normals.covariance, np.swapaxes(normals.covariance, 1, 2))
        assert np.linalg.eigvalsh(normals.covariance).min(initial=1.0) > 0.0
        assert normals.weight.sum() == pytest.approx(float(normals.form.size > 0))
    assert stepped_on >= 3


@pytest.mark.parametrize("form", [0, 3, 7, 3 + FORM_SIZE.size // 2])
def test_moments_without_the_last_test_are_those_of_draws_that_hardly_know_it(form: int) -> None:
    """An event lies before the last test. The witness knows it with a deviation of a thousand times the quantity; 40,000
    draws leave half a per cent of a deviation, and the tolerance is five times that."""
    count, tests = 40_000, [*CAMPAIGN[:8], replace(CAMPAIGN[8], epoch=1)]
    state = followed(Particle(), PRIOR, tests[:8])
    one = np.full(count, np.flatnonzero(state.cloud.form == state.cloud.form[0])[0])
    cloud = replace(state.cloud.taken(one), form=np.full(count, float(form)))
    entered = Particle().entered(replace(state, cloud=cloud), tests[8])
    history, reference = entered.history, tests[7].progress
    means, factors = before_last(entered, reference)

    points = entered.cloud.placed()
    blind = replace(history, variance=np.append(history.variance[:-1], (1e3 * PRIOR.size) ** 2))
    solved, rng = linear_model.pointwise(blind, PRIOR, points), np.random.default_rng(1)
    normals = rng.standard_normal((count, 2))
    draws = with_linear_terms(blind, PRIOR, points, solved, np.full(count, 1.0 / count), normals, rng)
    beside = draws.discrepancy
    delta = beside.curvature[:, :PAST] @ value_and_slope(reference, history.span).T
    at_reference = draws.initial + draws.change * progress_fraction(reference, draws.scale, draws.exponent)
    rows = np.column_stack([draws.initial, at_reference, delta, beside.height]) / PRIOR.initial_sd
    mean, covariance = means[0, [0, 1, 4, 5, 7]], factors[..., 0].T @ factors[..., 0]
    deviation = np.maximum(rows.std(axis=0), 1e-12)
    off = np.array([PRIOR.initial_mean, PRIOR.initial_mean, 0.0, 0.0, 0.0]) / PRIOR.initial_sd
    np.testing.assert_allclose((mean + off - rows.mean(axis=0)) / deviation, 0.0, atol=0.025)
    np.testing.assert_allclose(
        (covariance - np.cov(rows.T)) / np.outer(deviation, deviation), 0.0, atol=0.03, err_msg=str(form)
    )
    np.testing.assert_allclose(np.ptp(means, axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("form", [0, 2, 2 + FORM_SIZE.size // 2])
def test_a_step_from_narrow_normals_is_that_of_the_linear_filter(form: int) -> None:
    """Eq. 6 alone, with a discrepancy beside it, and with scatter that is a share of the value: where a normal is so narrow
    that the law is straight within it, the step is Kalman's, written out with the law's gradient."""
    rng, reference, after = np.random.default_rng(1), 10_000.0, 12_000.0
    centre = scaled(PRIOR, np.array([[0.13, 0.095, 8.4, -0.3, 1e-4, 2e-4, -7.9]]))[0]
    root = 1e-4 * rng.standard_normal((7, 7))
    covariance = root @ root.T
    history = History.of(sent([0.0, reference, after], [0.13, 0.095, 0.0905], 1e-10), PRIOR)
    (_, (mean, found)), (_, (outlying, _)) = _taken_in(centre, covariance, form, reference, history, PRIOR)

    def law(x: FloatArray) -> float:
        initial, at_reference, log_scale, log_exponent, delta, *_ = unscaled(PRIOR, x)
        share = progress_fraction(np.array([after, reference]), math.exp(log_scale), math.exp(log_exponent))
        return float((initial + (at_reference - initial) * share[0] / share[1] + delta) / PRIOR.initial_sd)

    gap, move, unit = 0.2, np.eye(7), PRIOR.initial_sd
    move[4, 5] = gap
    noise = 1e-9 * np.eye(7)
    at_the_last = FORM_SIZE[form] * PRIOR.size / unit * (reference / after) ** 1.5
    noise[4:6, 4:6] += 3.0 * at_the_last**2 * Q_continuous_white_noise(2, dt=gap)
    before, spread = move @ centre, move @ covariance @ move.T + noise
    gradient = np.array([(law(before + h) - law(before - h)) / 2e-5 for h in 1e-5 * np.eye(7)])
    scatter = math.exp(-2.0 * 7.9) * (PRIOR.relative_squared(0.0905) if FORM_PROPORTIONAL[form] else 1.0)
    variance = gradient @ spread @ gradient + (history.variance[-1] + scatter) / unit**2
    gain = spread @ gradient / variance
    innovation = 0.0905 / unit - law(before)
    assert np.abs(gain * innovation).max() > 1e-5
    np.testing.assert_allclose(mean, before + gain * innovation, atol=0.02 * np.abs(gain * innovation).max())
    np.testing.assert_allclose(found, spread - np.outer(gain, gain) * variance, atol=0.02 * spread.max())
    assert np.abs(outlying - before).max() < 0.2 * np.abs(mean - before).max()


@pytest.mark.parametrize("count", [6, 9, 13])
def test_the_ukf_is_near_the_exact_filter_on_eq_6(count: int) -> None:
    """Its quantiles of the end within a tenth of the exact ones' logarithm up to the median, and its weights of eq. 6."""
    exact = on_grid(CAMPAIGN[:count], 2_000, np.random.default_rng(1), PRIOR)
    found = Ukf().posterior(followed(Ukf(), PRIOR, CAMPAIGN[:count]), 2_000, np.random.default_rng(1))
    ends = [
        predict_first_passage(draws, fraction=0.5, as_of=CAMPAIGN[count - 1].progress).end_of_life
        for draws in (found, exact)
    ]
    for quantile in (0.25, 0.5):
        assert ends[0][quantile] == pytest.approx(ends[1][quantile], rel=0.1), quantile
    eq_6 = [float(draws.weight @ (draws.course == 0)) for draws in (found, exact)]
    assert eq_6[0] == pytest.approx(eq_6[1], abs=0.1)


def test_the_ukf_books_the_step_of_each_event_on_that_event() -> None:
    """A life whose level steps up by 0.02 at 12,000 cycles, and an event without effect at 29,000."""
    progress, rng = np.linspace(0.0, 40_000.0, 31), np.random.default_rng(0)
    cof = value(progress, TYPICAL) + 0.02 * (progress >= 12_000.0) + 0.0004 * rng.standard_normal(31)
    runs = sent(progress, cof, 1e-8, 1 * (progress >= 12_000) + (progress >= 29_000))
    prior = weak(runs[0], falling=True)
    posterior = Ukf().posterior(followed(Ukf(), prior, runs), 1_000, rng)
    exact = on_grid(runs, 1_000, rng)
    assert posterior.discrepancy.height.mean(axis=0) == pytest.approx([0.02, 0.0], abs=0.002)
    ends = [predict_first_passage(found, fraction=0.5, as_of=40_000.0) for found in (posterior, exact)]
    assert [end.status for end in ends] == [PassageStatus.PREDICTED] * 2
    assert ends[0].end_of_life[0.5] == pytest.approx(ends[1].end_of_life[0.5], rel=0.05)


@pytest.mark.slow
def test_the_ukf_bears_more_events_than_anyone_logs() -> None:
    """A sensor is zeroed before each of 60 tests: each begins an epoch, and has a step of its own."""
    rng = np.random.default_rng(5)
    progress = np.linspace(0.0, 20_000.0, 60)
    cof = value(progress, TYPICAL)
    runs = sent(progress, cof + 0.0004 * rng.standard_normal(60), 1e-8, np.arange(60))
    state = followed(Ukf(), weak(runs[0], falling=True), runs)
    assert state.normals.mean.shape[1] == 7 + 59
    posterior = Ukf().posterior(state, 500, rng)
    now, deviation = posterior.moments(posterior.values(np.array([20_000.0]))[0])
    assert abs(now - cof[-1]) < 4.0 * deviation + 0.01
    assert posterior.weight.size == 500


def wandering() -> list[Measurement]:
    """A quantity that wanders until no course fits."""
    progress = np.arange(4.0, 200.0, 4.0)
    values = 0.05 + 0.003 * np.sin(progress / 14.0) + 0.005 * (progress / 160.0) ** 6 * (progress < 165.0)
    return sent(progress, values, 1e-8)


def test_no_course_that_the_ukf_draws_ended_before_the_last_test() -> None:
    """Where no course fits: one that grows without bounds at an end behind would be thousands of times the quantity."""
    measurements, ended, rng = wandering(), 0.0, np.random.default_rng(0)
    state = followed(Ukf(), weak(measurements[0], falling=True), measurements[:20], rng)
    for measurement in measurements[20:]:
        state = Ukf().update(state, measurement, rng)
        draws = Ukf().posterior(state, 2_000, np.random.default_rng(7))
        behind = (draws.scale < 0.0) & (-draws.scale <= state.history.span)
        ended = max(ended, float(behind.mean()))
        assert float(draws.weight @ behind) == 0.0
        assert abs(float(draws.weight @ draws.values(np.array([measurement.progress]))[0]) - measurement.value) < 0.02
    assert ended > 0.0, "the case shows nothing: no course was drawn beyond its end"


def test_where_courses_that_the_normals_hold_have_ended_the_answer_of_the_ukf_is_the_particles() -> None:
    """Normals of growing courses that end just beyond the test before the last."""
    measurements = wandering()
    state = followed(Ukf(), weak(measurements[0], falling=True), measurements[:20])
    growing = SCALE_SIGN[FORM_COURSE[state.normals.form.astype(np.intp)]] < 0.0
    share = state.normals.weight * growing
    assert share.any()
    ended = replace(state.normals, weight=share / share.sum(), mean=state.normals.mean.copy())
    ended.mean[growing, 2] = -DOMAIN
    ended.covariance[:] *= 1e-12
    for normals, those_of_particles in ((state.normals, False), (ended, True)):
        draws = Ukf().posterior(replace(state, normals=normals), 500, np.random.default_rng(0))
        assert np.isin(draws.scatter, np.exp(state.particles.cloud.points[:, 2])).all() == those_of_particles
