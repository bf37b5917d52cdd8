"""Each filter against others, closed forms and dense grids."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from scipy.integrate import trapezoid

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction, value
from models.prognosis.first_passage import PassageStatus, predict_first_passage, weighted_quantiles
from models.tracking import linear_model
from models.tracking.courses import FORM_COURSE, SCALE_SIGN, WITHOUT_EXPONENT, log_form_weight
from models.tracking.criteria import COURSE_SHARES, EQ_6_SHARE, KNEE_HAZARD, PROPORTIONAL_SHARE
from models.tracking.filters import ukf
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import DOMAIN, Ukf, scatter_learnt, unscaled
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
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
    flags = ["outlying"] if tracker.name == "particle" else []
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
STORED_NAMES = {
    "grid": SERIES,
    "particle": SERIES | {"points", "form", "outlying", "log_weight", "log_target"},
    "ukf": SERIES | {"place", "form", "log_weight", "mean", "covariance", "scatter"},
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


# --- The unscented filters: domain, scatter, and starting anew.


def test_the_ukf_stays_in_its_domain_and_definite() -> None:
    for measurements in WEIRD.values():
        state = followed(Ukf(), weak(measurements[0], falling=True), measurements)
        if len(measurements) < Ukf().together:
            assert state.form.size == 0
            continue
        assert np.abs(state.mean).max() <= 6.0
        np.testing.assert_array_equal(state.covariance, np.swapaxes(state.covariance, 1, 2))
        assert np.linalg.eigvalsh(state.covariance).min() > 0.0


def test_the_ukf_learns_the_scatter_from_its_innovations() -> None:
    """Innovations of a scatter three times as large as believed, beside fits as uncertain as that belief: after 600
    the scatter is known to 15 % (their number alone leaves 6 %)."""
    believed, truth, rng = 3e-4, 9e-4, np.random.default_rng(0)
    scatter, unit = np.array([believed**2, 2.0]), PRIOR.initial_sd
    for _ in range(600):
        variance = (scatter[0] + believed**2) / unit**2
        off = rng.normal(0.0, math.hypot(truth, believed)) / unit
        scatter = scatter_learnt(PRIOR, scatter, off**2 / variance, variance, 1.0)
    assert math.sqrt(scatter[0]) == pytest.approx(truth, rel=0.15)
    assert scatter[1] == 602.0
    # no innovation teaches the ukf more than five deviations do
    start = np.array([9e-8, 20.0])
    learnt = [
        float(scatter_learnt(PRIOR, start, surprise, 1.1 * 9e-8 / PRIOR.initial_sd**2, 1.0)[0])
        for surprise in (9.0, 25.0, 1e4)
    ]
    assert learnt[1] == learnt[2] > learnt[0] > 9e-8
    assert scatter_learnt(PRIOR, start, 1e4, 1.0, 0.0)[0] == start[0]


def test_a_lost_ukf_starts_anew_from_the_whole_history() -> None:
    """After runs that the filter cannot explain (a life that all at once falls twice as fast) it is where the grid is."""
    progress = np.concatenate([np.linspace(0.0, 9e3, 10), np.linspace(9.3e3, 1.6e4, 20)])
    values = [0.13 - 2e-6 * z - 6e-6 * max(0.0, z - 9e3) for z in progress]
    bent = sent(progress, values, 1e-8)
    assert followed(Ukf(), PRIOR, CAMPAIGN[:11]).reference == CAMPAIGN[7].progress
    assert followed(Ukf(), PRIOR, bent).reference > 1e4


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


def test_the_ukf_bears_more_events_than_anyone_logs() -> None:
    """A sensor is zeroed before each of 60 tests: each begins an epoch, and has a step of its own."""
    rng = np.random.default_rng(5)
    progress = np.linspace(0.0, 20_000.0, 60)
    cof = value(progress, TYPICAL)
    runs = sent(progress, cof + 0.0004 * rng.standard_normal(60), 1e-8, np.arange(60))
    prior = weak(runs[0], falling=True)
    state = Ukf().update(replace(Ukf().start(prior), history=History.of(runs[:-1], prior)), runs[-1])
    assert state.mean.shape[1] == 6 + 59
    posterior = Ukf().posterior(state, 500, rng)
    now, deviation = posterior.moments(posterior.values(np.array([20_000.0]))[0])
    assert abs(now - cof[-1]) < 4.0 * deviation + 0.01
    assert posterior.weight.size == 500


def test_a_step_of_all_filters_at_once_is_filterpys_step_of_each() -> None:
    """Two filters of eq. 6, one with a discrepancy beside it, led on a fifth of their progress: means, covariances and
    the measurement's moments are those of filterpy, filter by filter."""
    state = followed(Ukf(), PRIOR, CAMPAIGN[:9])
    of = np.flatnonzero(np.isin(state.form, state.form[:2]))
    normals = replace(
        state, form=np.array([0, 2]), **{n: getattr(state, n)[of] for n in ("mean", "covariance", "scatter")}
    )
    assert normals.mean.shape == (2, 6)
    last, reference, unit = CAMPAIGN[8].progress, state.reference, PRIOR.initial_sd
    after = 1.2 * last
    history = normals.history.append(Measurement(progress=after, value=0.1, variance=0.0), PRIOR)

    def moved(x: FloatArray, _: float) -> FloatArray:
        return x + np.eye(6)[4] * x[5] * 0.2 * last / reference

    def seen(x: FloatArray) -> FloatArray:
        initial, at_reference, log_scale, log_exponent, beside, _ = unscaled(PRIOR, x)
        share, whole = progress_fraction(np.array([after, reference]), np.exp(log_scale), np.exp(log_exponent))
        return np.array([(initial + (at_reference - initial) * share / whole + beside) / unit])

    mean, covariance = ukf.predicted(normals, history)
    noise = covariance - ukf.predicted(replace(normals, form=np.zeros(2, dtype=np.intp)), history)[1]
    assert noise[0].max() == 0.0 < noise[1].max()
    white = Q_continuous_white_noise(2, dt=0.2 * last / reference)
    np.testing.assert_allclose(noise[1, 4:, 4:] / noise[1, 5, 5], white / white[1, 1], rtol=1e-9)
    expected, variance, across = ukf.measured(normals, mean, covariance, after)
    for one in range(2):
        points = MerweScaledSigmaPoints(n=6, alpha=1.0, beta=0.0, kappa=0.0)
        theirs = UnscentedKalmanFilter(dim_x=6, dim_z=1, dt=1.0, hx=seen, fx=moved, points=points)
        theirs.x, theirs.P = normals.mean[one], normals.covariance[one]
        theirs.Q, theirs.R = noise[one] + 1e-9 * np.eye(6), np.array([[0.0]])
        theirs.predict()
        theirs.update(np.array([0.1 / unit]))
        np.testing.assert_allclose(mean[one], theirs.x_prior, rtol=0, atol=1e-12)
        np.testing.assert_allclose(covariance[one], theirs.P_prior, rtol=0, atol=1e-12)
        assert expected[one] == pytest.approx(0.1 / unit - theirs.y[0], rel=1e-12)
        assert variance[one] == pytest.approx(theirs.S[0, 0], rel=1e-9)
        np.testing.assert_allclose(across[one], theirs.K[:, 0] * theirs.S[0, 0], rtol=0, atol=1e-12)


def wandering() -> list[Measurement]:
    """A quantity that wanders until no course fits."""
    progress = np.arange(4.0, 200.0, 4.0)
    values = 0.05 + 0.003 * np.sin(progress / 14.0) + 0.005 * (progress / 160.0) ** 6 * (progress < 165.0)
    return sent(progress, values, 1e-8)


def test_no_course_that_the_ukf_draws_ended_before_the_last_test() -> None:
    """Where no course fits: one that grows without bounds at an end behind would be thousands of times the quantity."""
    measurements, ended = wandering(), 0.0
    state = followed(Ukf(), weak(measurements[0], falling=True), measurements[:20])
    for measurement in measurements[20:]:
        state = Ukf().update(state, measurement)
        draws = Ukf().posterior(state, 2_000, np.random.default_rng(7))
        behind = (draws.scale < 0.0) & (-draws.scale <= state.history.span)
        ended = max(ended, float(behind.mean()))
        assert float(draws.weight @ behind) == 0.0
        assert abs(float(draws.weight @ draws.values(np.array([measurement.progress]))[0]) - measurement.value) < 0.02
    assert ended > 0.0, "the case shows nothing: no course was drawn beyond its end"


def test_where_every_drawn_course_has_ended_all_are_kept_alike() -> None:
    """Normals of growing courses whose end is just beyond the reference, and a last measurement at twice that."""
    measurements = wandering()
    state = followed(Ukf(), weak(measurements[0], falling=True), measurements[:20])
    growing = SCALE_SIGN[FORM_COURSE[state.form.astype(np.intp)]] < 0.0
    assert growing.any()
    normals = {name: getattr(state, name)[growing] for name in ("form", "log_weight", "mean", "covariance", "scatter")}
    normals["mean"][:, 2] = -DOMAIN
    normals["covariance"] *= 1e-12
    history = state.history.append(replace(measurements[20], progress=2.0 * state.reference), state.prior)
    state = replace(state, **normals, history=history)
    drawn = Ukf().posterior(state, 500, np.random.default_rng(0))
    assert (-drawn.scale <= state.history.span).all(), "the case shows nothing: a course has not ended"
    np.testing.assert_array_equal(drawn.weight, 1.0 / 500)


def test_before_the_first_measurement_the_ukf_draws_from_the_prior_and_has_no_normals() -> None:
    state = Ukf().start(PRIOR)
    assert state.mean.shape == (0, 6)
    drawn = Ukf().posterior(state, 4_000, np.random.default_rng(0))
    mean, deviation = drawn.moments(drawn.initial)
    assert mean == pytest.approx(PRIOR.initial_mean, abs=0.05 * PRIOR.initial_sd)
    assert deviation == pytest.approx(PRIOR.initial_sd, rel=0.05)
    assert same(type(state).from_arrays(state.to_arrays()), state)
