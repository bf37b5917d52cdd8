"""The grid against plain quadrature, the prior and itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from models.tracking import linear_model
from models.tracking.courses import WITHOUT_EXPONENT
from models.tracking.criteria import COURSE_SHARES, EQ_6_SHARE
from models.tracking.filters.grid import Grid
from models.tracking.history import History
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    PLAIN,
    PRIOR,
    TYPICAL,
    followed,
    same,
    series,
)


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
