"""Draws with less noise than independent ones."""

import numpy as np

from models.tracking import sampling


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
