"""Each filter against others, closed forms and dense grids."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from models.prognosis.first_passage import predict_first_passage, weighted_quantiles
from models.tracking import linear_model
from models.tracking.courses import WITHOUT_EXPONENT, log_form_weight
from models.tracking.criteria import COURSE_SHARES, EQ_6_SHARE, KNEE_HAZARD, PROPORTIONAL_SHARE
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.filters.ukf import Ukf, UkfState
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
    measured,
    same,
    series,
)

# --- What each of the three filters must do on any series, and where they must agree. Large comparisons:
# tests/statistical.


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
@pytest.mark.parametrize("falling", [True, False])
@pytest.mark.parametrize("case", WEIRD)
def test_any_series_leaves_finite_numbers(tracker: Any, state_type: Any, falling: bool, case: str) -> None:
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
    assert isinstance(state, state_type)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_a_seed_gives_the_same_answer_twice(tracker: Any, state_type: Any) -> None:
    first, second = (followed(tracker, PRIOR, CAMPAIGN, seed=5) for _ in range(2))
    assert same(first, second)
    draws = [tracker.posterior(first, 500, np.random.default_rng(2)) for _ in range(2)]
    assert all(np.array_equal(getattr(draws[0], n), getattr(draws[1], n)) for n in COLUMNS)
    places = np.array([0.0, 6e3, 5e4])
    assert np.array_equal(draws[0].values(places), draws[1].values(places))
    assert isinstance(first, state_type)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_a_state_survives_its_arrays_exactly(tracker: Any, state_type: Any) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN[:7], seed=5)
    arrays = state.to_arrays()
    assert all(column.dtype == np.float64 for column in arrays.values())
    again = state_type.from_arrays({name: column.copy() for name, column in reversed(arrays.items())})
    assert list(again.to_arrays()) == list(arrays)
    assert same(state, again)
    steps = [tracker.update(s, CAMPAIGN[7], np.random.default_rng(9)) for s in (state, again)]
    assert same(*steps)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_an_update_leaves_the_old_state_alone(tracker: Any, state_type: Any) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN[:7], seed=5)
    before = {name: column.copy() for name, column in state.to_arrays().items()}
    tracker.update(state, CAMPAIGN[7], np.random.default_rng(1))
    assert same(state, state_type.from_arrays(before))


def test_particle_and_grid_agree_on_the_coefficients() -> None:
    """Means within 0.2 deviations: 2,000 particles that count as 500 leave 0.045; four times that is allowed."""
    posteriors = [
        tracker.posterior(followed(tracker, PRIOR, CAMPAIGN), 2_000, np.random.default_rng(1))
        for tracker in (Particle(), Grid())
    ]
    for name in ("initial", "change", "scale", "exponent", "scatter"):
        (particle, _), (grid, sd) = (p.moments(np.log(np.abs(getattr(p, name)))) for p in posteriors)
        assert abs(particle - grid) < 0.2 * sd, name


SERIES = {"prior", "progress", "value", "variance", "epoch", "new_levels"}


STORED_NAMES = {
    "grid": SERIES,
    "particle": SERIES | {"points", "form", "outlying", "log_weight", "log_target"},
    "ukf": SERIES | {"place", "form", "log_weight", "mean", "covariance", "scatter"},
}


@pytest.mark.parametrize(
    ("tracker", "state_type"), [(Grid(), GridState), (Particle(particles=50), ParticleState), (Ukf(), UkfState)]
)
def test_stored_arrays_have_the_names_of_this_version(tracker, state_type) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN)
    arrays = state.to_arrays()
    assert arrays.keys() == STORED_NAMES[tracker.name]
    # in the order of the fields of Prior, of which 0.05 is the share of outlying runs and 0.1 their size
    assert arrays["prior"].tolist()[10:] == [0.05, 0.1, 0.95, 0.05, EQ_6_SHARE, PROPORTIONAL_SHARE, KNEE_HAZARD]
    again = state_type.from_arrays({name: np.array(column) for name, column in arrays.items()}).to_arrays()
    assert all((again[name] == column).all() for name, column in arrays.items())


# --- The grid against plain quadrature, the prior and itself.


def test_a_whole_history_at_once_is_what_updates_fold_to() -> None:
    grid = Grid(nodes=13, rows=13, levels=7)
    whole = grid.from_history(PRIOR, CAMPAIGN)
    assert same(whole, followed(grid, PRIOR, CAMPAIGN))
    assert not same(whole, grid.from_history(PRIOR, CAMPAIGN[::-1]))


def test_the_order_of_runs_does_not_matter_to_the_grid() -> None:
    """Only the order of sums differs."""
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
    grid = Grid()
    long = series(TYPICAL, np.linspace(0.0, 15_000.0, 40), 4e-4)
    posterior = grid.posterior(grid.from_history(PRIOR, long), 2_000, np.random.default_rng(0))
    assert 1.0 / np.square(posterior.weight).sum() > 0.4 * 2_000


def test_the_marginal_of_log_scale_against_plain_quadrature() -> None:
    """ε and s held nearly fixed by their prior, the posterior of log φ is a one-dimensional integral."""
    prior = replace(PLAIN, log_exponent_sd=1e-3, log_scatter_sd=1e-3, log_exponent_mean=-0.36, log_scatter_mean=-7.8)
    log_scale = np.linspace(7.5, 9.5, 4_001)
    history = History.of(CAMPAIGN, prior)
    points = linear_model.Points(
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
    posterior = Grid().posterior(Grid().from_history(prior, CAMPAIGN), 4_000, np.random.default_rng(0))
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
    state = followed(Particle(particles=200), PRIOR, measured([0.0, 1e3, 7e3, 15e3], [0.13, 0.115, 0.085, 0.068]))
    placed = state.cloud.placed()
    target = linear_model.evidence(linear_model.pointwise(state.history, PRIOR, placed)[0], PRIOR)
    target += PRIOR.log_density(*state.cloud.points.T) + linear_model.log_outlying(PRIOR, placed.outlying)
    target += log_form_weight(PRIOR)[state.cloud.form.astype(int)]
    np.testing.assert_allclose(state.cloud.log_target, target, rtol=1e-7, atol=1e-7)


def fallen(low: int) -> list[Measurement]:
    """Eight tests of a level that does not move, and then so many at 60 % of it, which no event explains."""
    rng = np.random.default_rng(1)
    level = [0.13] * 8 + [0.078] * low
    return measured(1_000.0 * np.arange(8 + low), np.array(level) * (1.0 + 0.003 * rng.standard_normal(8 + low)))


@pytest.mark.parametrize("low", [2, 3, 5])
@pytest.mark.parametrize("tracker", [Particle(), Ukf()])
def test_friction_that_has_fallen_at_once_is_followed_from_the_second_test_on(tracker, low: int) -> None:
    """One such test may be outlying; two are the present, which goes no lower by itself."""
    history = fallen(low)
    prior = weak(history[0], falling=True)
    exact, sample = (
        each.posterior(followed(each, prior, history), 1_000, np.random.default_rng(1)) for each in (Grid(), tracker)
    )
    here = np.array([history[-1].progress])
    medians = [weighted_quantiles(draws.values(here)[0], draws.weight, (0.05, 0.5, 0.95)) for draws in (exact, sample)]
    np.testing.assert_allclose(medians[1], medians[0], atol=0.005)
    assert medians[1][1] == pytest.approx(0.078, abs=0.002)
