"""The three filters: what each must do on any series, and where they must agree. Large comparisons are statistical."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from models.prognosis.first_passage import predict_first_passage
from models.tracking import linear_model
from models.tracking.discrepancy import log_size_weight
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.sigma_points import scatter_learnt
from models.tracking.filters.ukf import Ukf
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
    followed,
    measured,
    same,
    series,
)

WEIRD = {
    "one": measured([0.0], [0.13]),
    "constant": measured([0.0, 1e3, 2e3, 3e3, 4e3, 5e3], [0.13] * 6),
    "rising": measured([0.0, 1e3, 2e3, 3e3, 4e3], [0.10, 0.12, 0.14, 0.16, 0.18]),
    "jump": measured([0.0, 1e3, 2e3, 3e3, 4e3, 5e3], [0.13, 0.129, 0.128, 0.04, 0.039, 0.2]),
    "noise free": series(replace(TYPICAL), np.linspace(0.0, 3e4, 31), 0.0),
    "same progress": measured([0.0, 0.0, 5e3, 5e3, 5e3], [0.13, 0.131, 0.1, 0.1, 0.101]),
    "out of order": measured([7e3, 0.0, 15e3, 1e3], [0.08, 0.13, 0.065, 0.11]),
    "huge gap": measured([0.0, 1.0, 2.0, 9e5], [0.13, 0.13, 0.13, 0.02]),
    "zero": measured([0.0, 1e3, 2e3], [0.0, 1e-5, 2e-5]),
    "tiny unit": measured([0.0, 1e3, 7e3, 15e3], [2e-9, 2.4e-9, 3.1e-9, 3.3e-9]),
    "negative": measured([0.0, 1e3, 7e3, 15e3], [-3.0, -2.5, -2.0, -1.9]),
}


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
    assert min(posterior.scale.min(), posterior.exponent.min(), posterior.scatter.min()) > 0.0
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
    posterior = Grid().posterior(Grid().start(PRIOR), 4_000, np.random.default_rng(0))
    for sample, mean, sd in (
        (posterior.initial, PRIOR.initial_mean, PRIOR.initial_sd),
        (posterior.change, PRIOR.change_mean, PRIOR.change_sd),
        (np.log(posterior.scale), PRIOR.log_scale_mean, PRIOR.log_scale_sd),
        (np.log(posterior.exponent), PRIOR.log_exponent_mean, PRIOR.log_exponent_sd),
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
        size=np.zeros(4_001),
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


def test_particle_and_grid_agree_on_the_coefficients() -> None:
    """Means within 0.2 deviations: 2,000 particles that count as 500 leave 0.045; four times that is allowed."""
    posteriors = [
        tracker.posterior(followed(tracker, PRIOR, CAMPAIGN), 2_000, np.random.default_rng(1))
        for tracker in (Particle(), Grid())
    ]
    for name in ("initial", "change", "scale", "exponent", "scatter"):
        (particle, _), (grid, sd) = (p.moments(np.log(np.abs(getattr(p, name)))) for p in posteriors)
        assert abs(particle - grid) < 0.2 * sd, name


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


def test_a_measurement_let_in_by_degrees_still_counts_once() -> None:
    """After starving measurements every particle's target is that of the whole history, taken at once."""
    state = followed(Particle(particles=200), PRIOR, measured([0.0, 1e3, 7e3, 15e3], [0.13, 0.115, 0.085, 0.068]))
    placed = state.cloud.placed()
    target = linear_model.evidence(linear_model.pointwise(state.history, PRIOR, placed)[0], PRIOR)
    target += PRIOR.log_density(*state.cloud.points.T) + linear_model.log_outlying(PRIOR, placed.outlying)
    target += log_size_weight(PRIOR)[state.cloud.size.astype(int)]
    np.testing.assert_allclose(state.cloud.log_target, target, rtol=1e-7, atol=1e-7)


def test_the_ukf_stays_in_its_domain_and_definite() -> None:
    for measurements in WEIRD.values():
        state = followed(Ukf(), weak(measurements[0], falling=True), measurements)
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


def test_no_innovation_teaches_the_ukf_more_than_five_deviations_do() -> None:
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
    bent = [
        Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(progress, values, strict=True)
    ]
    assert followed(Ukf(), PRIOR, CAMPAIGN[:11]).reference == CAMPAIGN[7].progress
    assert followed(Ukf(), PRIOR, bent).reference > 1e4


def test_the_weak_prior_scales_with_the_quantity() -> None:
    """The same clutch in another unit has the same life."""
    big = [replace(m, value=1e3 * m.value, variance=1e6 * m.variance) for m in CAMPAIGN]
    lives = []
    for measurements in (CAMPAIGN, big):
        state = Grid().from_history(weak(measurements[0], falling=True), measurements)
        passage = predict_first_passage(Grid().posterior(state, 500, np.random.default_rng(3)), fraction=0.5, as_of=0.0)
        lives.append(passage.end_of_life[0.5])
    assert lives[0] == pytest.approx(lives[1], rel=1e-6)


@pytest.mark.parametrize("life", [1e2, 1e4, 1e6])
def test_lives_of_any_length_are_tractable(life: float) -> None:
    """Measured to 90 % of its life, the end is found within 10 %, whatever the length of the life."""
    d = replace(TYPICAL, scale=life / 7.4)
    state = Grid().from_history(PRIOR, series(d, np.linspace(0.0, 0.9, 30) * life, 2e-4))
    passage = predict_first_passage(
        Grid().posterior(state, 1_000, np.random.default_rng(3)), fraction=0.5, as_of=0.9 * life, horizon=1e7
    )
    true_end = d.scale * ((1.0 - 0.067 / 0.1) ** (-1.0 / 0.7) - 1.0)
    assert passage.end_of_life[0.5] == pytest.approx(true_end, rel=0.1)


def test_the_weak_prior_is_what_it_says() -> None:
    prior = weak(Measurement(progress=0.0, value=0.2, variance=0.0), falling=True)
    assert (prior.initial_mean, prior.initial_sd) == (0.2, 0.1)
    assert (prior.change_mean, prior.change_sd) == (pytest.approx(-0.12), pytest.approx(0.08))
    assert (math.exp(prior.log_scale_mean), prior.log_scale_sd) == (pytest.approx(4_000.0), 2.3)
    assert (math.exp(prior.log_exponent_mean), prior.log_exponent_sd) == (pytest.approx(0.8), 0.7)
    assert (math.exp(prior.log_scatter_mean), prior.log_scatter_sd) == (pytest.approx(6e-4), 0.8)
    rising = weak(Measurement(progress=0.0, value=0.2, variance=0.0), falling=False)
    assert (rising.change_mean, rising.change_sd) == (0.0, pytest.approx(0.2))


def test_values_are_told_apart_to_their_resolution_and_no_finer() -> None:
    history = History.of(CAMPAIGN[:1], PRIOR)
    resolution = 1e-6 * math.hypot(PRIOR.initial_sd, PRIOR.change_sd)
    assert history.variance[0] == pytest.approx(1e-8 + resolution**2, rel=1e-12)
    assert history.variance[0] > 1e-8
