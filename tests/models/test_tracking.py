"""The three filters: what each must do on any series, and where they must agree. Large comparisons are statistical."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import trapezoid

from models.degradation import Degradation, value
from models.prognosis import first_passage
from models.tracking import linear
from models.tracking.grid import Grid, GridState
from models.tracking.measurement import Measurement
from models.tracking.particle import Particle, ParticleState
from models.tracking.prior import Prior, weak
from models.tracking.protocol import Posterior
from models.tracking.ukf import Ukf, UkfState

FILTERS = [(Grid(), GridState), (Particle(particles=300), ParticleState), (Ukf(), UkfState)]
NAMES = [tracker.name for tracker, _ in FILTERS]
TYPICAL = Degradation(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7)


def series(d: Degradation, progress: np.ndarray, noise: float, seed: int = 0) -> list[Measurement]:
    rng = np.random.default_rng(seed)
    values = value(progress, d) + noise * rng.standard_normal(progress.size)
    return [
        Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(progress, values, strict=True)
    ]


def measured(progress: list[float], values: list[float]) -> list[Measurement]:
    return [Measurement(progress=z, value=y, variance=0.0) for z, y in zip(progress, values, strict=True)]


def followed(tracker: Any, prior: Prior, measurements: list[Measurement], seed: int = 0) -> Any:
    rng, state = np.random.default_rng(seed), tracker.start(prior)
    for measurement in measurements:
        state = tracker.update(state, measurement, rng)
    return state


def same(a: Any, b: Any) -> bool:
    return all(np.array_equal(x, b.to_arrays()[name]) for name, x in a.to_arrays().items())


CAMPAIGN = series(TYPICAL, np.linspace(0.0, 12_000.0, 13), 4e-4)
PRIOR = weak(CAMPAIGN[0], falling=True)

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
    for name in Posterior.__slots__:
        column = getattr(posterior, name)
        assert column.shape == (400,)
        assert np.isfinite(column).all(), name
    assert posterior.weight.sum() == pytest.approx(1.0)
    assert min(posterior.scale.min(), posterior.exponent.min(), posterior.scatter.min()) > 0.0
    first_passage(posterior, fraction=0.5, as_of=measurements[-1].progress)
    assert isinstance(state, state_type)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_a_seed_gives_the_same_answer_twice(tracker: Any, state_type: Any) -> None:
    first, second = (followed(tracker, PRIOR, CAMPAIGN, seed=5) for _ in range(2))
    assert same(first, second)
    draws = [tracker.posterior(first, 500, np.random.default_rng(2)) for _ in range(2)]
    assert all(np.array_equal(getattr(draws[0], n), getattr(draws[1], n)) for n in Posterior.__slots__)
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
    shared = grid.basis(PRIOR, np.array([m.progress for m in CAMPAIGN]))
    assert same(whole, grid.from_history(PRIOR, CAMPAIGN, shared))


def test_the_order_of_runs_does_not_matter_to_the_grid() -> None:
    """Only the order of sums differs."""
    grid = Grid()
    there, back = grid.from_history(PRIOR, CAMPAIGN), grid.from_history(PRIOR, CAMPAIGN[::-1])
    np.testing.assert_allclose(there.mass, back.mass, atol=1e-9)


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
    prior = replace(PRIOR, log_exponent_sd=1e-3, log_scatter_sd=1e-3, log_exponent_mean=-0.36, log_scatter_mean=-7.8)
    log_scale = np.linspace(7.5, 9.5, 4_001)
    history = linear.History.of(CAMPAIGN)
    sums = linear.pointwise(history, prior, log_scale, np.full(4_001, -0.36), np.full(4_001, -7.8))
    density = linear.evidence(sums, prior) - 0.5 * ((log_scale - prior.log_scale_mean) / prior.log_scale_sd) ** 2
    density = np.exp(density - density.max())
    density /= trapezoid(density, log_scale)
    mean = trapezoid(density * log_scale, log_scale)
    sd = math.sqrt(trapezoid(density * (log_scale - mean) ** 2, log_scale))
    posterior = Grid().posterior(Grid().from_history(prior, CAMPAIGN), 4_000, np.random.default_rng(0))
    found = posterior.moments(np.log(posterior.scale))
    assert found[0] == pytest.approx(mean, abs=0.05 * sd)
    assert found[1] == pytest.approx(sd, rel=0.05)


def test_particle_and_grid_agree_on_the_coefficients() -> None:
    """Means within 0.2 deviations: 1,000 particles, half of them effective, leave 0.045; four times that is allowed."""
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
    """After a starving measurement the closed form on every particle is that of the whole history, taken at once."""
    state = followed(Particle(particles=200), PRIOR, measured([0.0, 1e3, 7e3, 15e3], [0.13, 0.115, 0.085, 0.068]))
    sums = linear.pointwise(state.history, PRIOR, *state.cloud.points.T)
    target = linear.evidence(sums, PRIOR) + PRIOR.log_density(*state.cloud.points.T)
    np.testing.assert_allclose(state.cloud.log_target, target, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(state.cloud.mean[:, 1], linear.conditional(sums, PRIOR).change, rtol=1e-5, atol=1e-9)


def test_the_ukf_stays_in_its_domain_and_definite() -> None:
    for measurements in WEIRD.values():
        state = followed(Ukf(), weak(measurements[0], falling=True), measurements)
        assert np.abs(state.mean).max() <= 5.0
        np.testing.assert_array_equal(state.covariance, state.covariance.T)
        assert np.linalg.eigvalsh(state.covariance)[0] > 0.0


def test_the_ukf_learns_a_larger_scatter() -> None:
    quiet, loud = (
        followed(Ukf(), PRIOR, series(TYPICAL, np.linspace(0.0, 2e4, 60), noise)).scatter_variance
        for noise in (1e-4, 4e-3)
    )
    assert loud > 2.0 * quiet


def test_the_weak_prior_scales_with_the_quantity() -> None:
    """The same clutch in another unit has the same life."""
    big = [replace(m, value=1e3 * m.value, variance=1e6 * m.variance) for m in CAMPAIGN]
    lives = []
    for measurements in (CAMPAIGN, big):
        state = Grid().from_history(weak(measurements[0], falling=True), measurements)
        passage = first_passage(Grid().posterior(state, 500, np.random.default_rng(3)), fraction=0.5, as_of=0.0)
        lives.append(passage.end_of_life[0.5])
    assert lives[0] == pytest.approx(lives[1], rel=1e-6)


@pytest.mark.parametrize("life", [1e2, 1e4, 1e6])
def test_lives_of_any_length_are_tractable(life: float) -> None:
    """Measured to 90 % of its life, the end is found within 10 %, whatever the length of the life."""
    d = replace(TYPICAL, scale=life / 7.4)
    state = Grid().from_history(PRIOR, series(d, np.linspace(0.0, 0.9, 30) * life, 2e-4))
    passage = first_passage(
        Grid().posterior(state, 1_000, np.random.default_rng(3)), fraction=0.5, as_of=0.9 * life, horizon=1e7
    )
    true_end = d.scale * ((1.0 - 0.067 / 0.1) ** (-1.0 / 0.7) - 1.0)
    assert passage.end_of_life[0.5] == pytest.approx(true_end, rel=0.1)
