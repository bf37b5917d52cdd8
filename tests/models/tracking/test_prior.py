"""Priors, measurements and histories check themselves; draws are even and as correlated as they should be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.degradation.general_order import first_passage
from models.prognosis.first_passage import predict_first_passage
from models.tracking import sampling
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior
from tests.models.tracking.tracked_series import CAMPAIGN, PRIOR, TYPICAL, on_grid, series

# --- The prior as numbers, and what the weak one covers.


def test_a_prior_survives_its_array_and_checks_itself() -> None:
    assert Prior.from_array(PRIOR.to_array()) == PRIOR
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


# --- Measurements check themselves.


@pytest.mark.parametrize("numbers", [(-1.0, 0.1, 0.0), (0.0, math.nan, 0.0), (0.0, 0.1, -1e-9), (math.inf, 0.1, 0.0)])
def test_measurements_check_themselves(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        Measurement(progress=numbers[0], value=numbers[1], variance=numbers[2])


# --- The resolution of values.


def test_values_are_resolved_to_their_resolution_and_no_finer() -> None:
    history = History.of(CAMPAIGN[:1], PRIOR)
    resolution = 1e-6 * math.hypot(PRIOR.initial_sd, PRIOR.change_sd)
    assert history.variance[0] == pytest.approx(1e-8 + resolution**2, rel=1e-12)
    assert history.variance[0] > 1e-8


# --- Draws with less noise than independent ones.


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
