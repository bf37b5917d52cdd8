"""What the filters are made of: the closed form of ξ0 and Δ, the prior, measurements and draws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from models.degradation import Degradation, progress_fraction, value
from models.tracking import linear, sampling
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior, weak

PROGRESS = np.linspace(0.0, 12_000.0, 13)
VALUES = value(PROGRESS, Degradation(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7))
CAMPAIGN = [
    Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(PROGRESS, VALUES, strict=True)
]
PRIOR = weak(CAMPAIGN[0], falling=True)


def test_evidence_is_that_of_the_whole_normal() -> None:
    """ξ0 and Δ integrated out, the data are normal: mean E[ξ0] + E[Δ] b, covariance σ0² 11ᵀ + σΔ² bbᵀ + diag(v+s²)."""
    history = linear.History.of(CAMPAIGN)
    points = np.array([[8.5, -0.3, -8.0], [7.0, 0.4, -6.5], [10.0, -1.0, -9.0]])
    found = linear.evidence(linear.pointwise(history, PRIOR, *points.T), PRIOR)
    for (log_scale, log_exponent, log_scatter), log_probability in zip(points, found, strict=True):
        b = progress_fraction(history.progress, math.exp(log_scale), math.exp(log_exponent))
        noise = np.diag(history.variance + math.exp(2 * log_scatter))
        spread = PRIOR.initial_sd**2 + PRIOR.change_sd**2 * np.outer(b, b) + noise
        expected = multivariate_normal(PRIOR.initial_mean + PRIOR.change_mean * b, spread).logpdf(history.value)
        assert log_probability == pytest.approx(expected, rel=1e-8)


def test_conditional_is_the_weighted_least_squares_solution() -> None:
    history = linear.History.of(CAMPAIGN)
    point = np.array([[8.5, -0.3, -8.0]])
    given = linear.conditional(linear.pointwise(history, PRIOR, *point.T), PRIOR)
    b = progress_fraction(history.progress, math.exp(8.5), math.exp(-0.3))
    design = np.stack([np.ones_like(b), b], axis=1) / np.sqrt(history.variance + math.exp(-16.0))[:, None]
    anchor = np.diag([PRIOR.initial_sd**-2, PRIOR.change_sd**-2])
    covariance = np.linalg.inv(anchor + design.T @ design)
    target = history.value / np.sqrt(history.variance + math.exp(-16.0))
    mean = covariance @ (anchor @ [PRIOR.initial_mean, PRIOR.change_mean] + design.T @ target)
    np.testing.assert_allclose([given.initial[0], given.change[0]], mean, rtol=1e-9)
    found = [given.initial_variance[0], given.covariance[0], given.change_variance[0]]
    np.testing.assert_allclose(found, covariance[[0, 0, 1], [0, 1, 1]], rtol=1e-9)


def test_the_table_and_the_points_are_one_sum() -> None:
    history = linear.History.of(CAMPAIGN)
    log_scale, log_exponent = np.array([7.0, 8.0, 9.0]), np.array([-0.5, 0.0, 0.5])
    table = linear.basis(history.progress[:, None], log_scale, log_exponent)
    tabled = linear.evidence(linear.tabulated(history, PRIOR, table, np.array([-8.0, -7.0])), PRIOR)
    for row, log_scatter in zip(tabled, (-8.0, -7.0), strict=True):
        pointed = linear.pointwise(history, PRIOR, log_scale, log_exponent, np.full(3, log_scatter))
        np.testing.assert_allclose(row, linear.evidence(pointed, PRIOR), rtol=1e-10)


def test_a_prior_survives_its_array_and_checks_itself() -> None:
    assert Prior.from_array(PRIOR.to_array()) == PRIOR
    with pytest.raises(ValueError, match="change_sd must be positive"):
        replace(PRIOR, change_sd=0.0)
    with pytest.raises(ValueError, match="initial_mean must be finite"):
        replace(PRIOR, initial_mean=math.nan)


@pytest.mark.parametrize("numbers", [(-1.0, 0.1, 0.0), (0.0, math.nan, 0.0), (0.0, 0.1, -1e-9), (math.inf, 0.1, 0.0)])
def test_measurements_check_themselves(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        Measurement(progress=numbers[0], value=numbers[1], variance=numbers[2])


def test_systematic_draws_share_out_the_weights() -> None:
    weight = np.array([0.5, 0.0, 0.3, 0.2])
    for offset in (0.0, 0.5, 0.999):
        assert np.bincount(sampling.systematic(weight, 10, offset), minlength=4).tolist() == [5, 0, 3, 2]


def test_spread_points_are_more_even_than_chance() -> None:
    """The share of 200 corners of the cube: these points err by less than half of what independent ones do."""
    rng = np.random.default_rng(0)
    edges = rng.random((200, 3))
    points = sampling.spread_points(1_000, np.full(3, 0.5))
    assert points.min() > 0.0
    assert points.max() < 1.0

    def error(sample: np.ndarray) -> float:
        shares = (sample[None] < edges[:, None]).all(axis=2).mean(axis=1)
        return float(np.sqrt(np.mean((shares - edges.prod(axis=1)) ** 2)))

    assert error(points) < 0.5 * error(rng.random((1_000, 3)))


def test_correlated_pairs_have_their_covariance() -> None:
    normals = sampling.spread_normals(20_000, np.full(2, 0.5))
    pair = sampling.correlated_pair(normals, np.full(20_000, 4.0), np.full(20_000, 1.0), np.full(20_000, -1.5))
    np.testing.assert_allclose(np.cov(pair, rowvar=False), [[4.0, -1.5], [-1.5, 1.0]], atol=0.02)
