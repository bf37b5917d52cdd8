"""Draws with less noise than independent ones: systematic resampling and an evenly spread sequence of points; and of all
that is linear, given points of the rest.

Sources: J. Carpenter et al., "Improved particle filter for nonlinear problems" (1999) for systematic resampling;
J. H. Halton, "On the efficiency of certain quasi-random sequences of points" (1960) for the sequence.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from models.arrays import FloatArray
from models.tracking.courses import FORM_PROPORTIONAL, UNIT_OF_CHANGE, coefficients_at
from models.tracking.discrepancy import PAST, drawn_discrepancy
from models.tracking.history import History
from models.tracking.linear_model import EvaluationPoints, Sums, Terms, drawn_pair, drawn_terms
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior


def systematic(weight: FloatArray, size: int, offset: float) -> NDArray[np.intp]:
    """Ascending indices [size] by systematic resampling: index i is drawn weight_i · size times up to rounding;
    `offset` is uniform in [0, 1)."""
    edges = np.cumsum(weight)
    drawn = np.searchsorted(edges, (np.arange(size) + offset) / size * edges[-1], side="right")
    return np.asarray(np.minimum(drawn, weight.size - 1), dtype=np.intp)


def normalised(log_weight: FloatArray) -> FloatArray:
    """Weights [n] from their logarithms, scaled to sum to one."""
    weight = np.exp(log_weight - log_weight.max())
    return np.asarray(weight / weight.sum())


def tempered(weight: FloatArray, log_factor: FloatArray, fewest: float = 60) -> FloatArray:
    """Normalised weights [n] times e^(τ log_factor), with the largest τ <= 1 of the sequence 1, 0.8, 0.64, … that
    leaves an effective sample size of `fewest`, or half of that without the factor if it is less."""
    normalized = weight / weight.sum()
    fewest = min(fewest, 0.5 / float(normalized @ normalized))
    off = log_factor - log_factor[weight > 0.0].max()
    while True:
        counted = normalized * np.exp(off)
        counted /= counted.sum()
        if 1.0 / float(counted @ counted) >= fewest:
            return np.asarray(counted)
        off = 0.8 * off


def thinned(sample: TrackPosterior, size: int, offset: float) -> TrackPosterior:
    """A weighted sample reduced to `size` draws of equal weight."""
    return sample.taken(systematic(sample.weight, size, offset), np.full(size, 1.0 / size))


def spread_points(size: int, offset: FloatArray) -> FloatArray:
    """Evenly spread points [size, d] of the open unit cube, d <= 5; a uniform offset [d] makes each of them uniform."""
    return np.clip((_halton(size, offset.size) + offset) % 1.0, 1e-9, 1.0 - 1e-9)


@lru_cache(maxsize=32)
def _halton(size: int, dimension: int) -> FloatArray:
    """Halton's points [size, d]: the digits of 1, 2, 3, ... in a prime base, mirrored at the point."""
    points = np.zeros((size, dimension))
    for column, base in zip(points.T, (2, 3, 5, 7, 11), strict=False):
        left, place = np.arange(1, size + 1), 1.0
        while left.any():
            left, digit = np.divmod(left, base)
            place /= base
            column += place * digit
    points.setflags(write=False)
    return points


def spread_normals(size: int, offset: FloatArray) -> FloatArray:
    """Evenly spread standard normals [size, d]."""
    return np.asarray(ndtri(spread_points(size, offset)), dtype=np.float64)


def with_linear_terms(
    history: History,
    prior: TrackPrior,
    points: EvaluationPoints,
    solved: tuple[Sums, Terms],
    weight: FloatArray,
    normals: FloatArray,
    rng: np.random.Generator,
) -> TrackPosterior:
    """A posterior sample from points of weights [n] that sum to one, with the linear terms drawn given each point: ξ0
    and Δ from standard normals [n, 2], discrepancy and steps from `rng`. `solved` is `linear_model.pointwise` of the
    points."""
    sums, terms = solved
    initial, change = drawn_pair(sums, prior, normals)
    further = rng.standard_normal((weight.size, PAST + history.steps.size))
    further = drawn_terms(terms, initial - prior.initial_mean, change, further)
    scale, exponent = coefficients_at(points.log_scale, points.log_exponent, points.course)
    worn = -change * points.basis(np.array([history.span]))[0] / initial
    return TrackPosterior(
        weight=weight,
        initial=initial,
        change=change / UNIT_OF_CHANGE[points.course],
        scale=scale,
        exponent=exponent,
        scatter=np.exp(points.log_scatter),
        proportional=FORM_PROPORTIONAL[points.form],
        discrepancy=drawn_discrepancy(history, prior, points.size, further, worn, rng),
    )
