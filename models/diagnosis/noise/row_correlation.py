"""Autocorrelation of neighbouring rows by restricted maximum likelihood, averaged over a grid of w ρ^{|i - j|}.

With A the contrasts of a piece (free of anything smooth) and R(w, ρ) the correlation of its rows,

    log L(w, ρ) = -½ (m ln s² + Σ_pieces ln |Aᵀ R A|),     s² = Σ xᵀ (Aᵀ R A)⁻¹ x/m,    x = Aᵀ residual,   m values in all
"""

from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.design.autocorrelation import Correlation
from models.diagnosis.noise.criteria import (
    CORRELATION_PRICE,
    CORRELATION_PRICE_FROM_SAMPLES,
    INFLATION_PRICE,
    MOST_KINDS,
    SPIKE,
)
from models.diagnosis.noise.smooth_free import Piece

#: The grid of ρ and of w.
_DECAYS = (0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
_SHARES = (0.15, 0.3, 0.5, 0.75, 1.0)


def estimate_correlation(
    pieces: Sequence[Piece],
    residual: FloatArray,
    deviation: FloatArray,
    from_samples: tuple[float, float] | None,
    period_differences: Sequence[FloatArray],
) -> tuple[Correlation, float]:
    """(w, ρ) of residual [N] Nm with deviation [N] Nm, and the factor by which the deviations are off.

    w ρ and w ρ², the correlations of the first and second neighbour, are averaged over the grid: a likelihood that is flat
    along a ridge must not choose its end. Where samples show both (`from_samples`), these are used unless bins contradict.
    `period_differences` [n] each are further series of neighbouring bins, in deviations, free of the loop as they are.
    """
    groups: dict[int, tuple[FloatArray, list[FloatArray]]] = {}
    for piece in pieces:
        relative = piece.remainder(residual) / deviation[piece.rows]
        groups.setdefault(id(piece.contrasts), (piece.contrasts, []))[1].append(np.clip(relative, -SPIKE, SPIKE))
    grid = [Correlation(), *(Correlation(share=share, decay=decay) for share in _SHARES for decay in _DECAYS)]
    expected, price = Correlation(), CORRELATION_PRICE
    if from_samples is not None:
        expected, price = Correlation.of_neighbours(*from_samples), CORRELATION_PRICE_FROM_SAMPLES
        grid = [expected, *grid]
    if (
        len(groups) > MOST_KINDS
    ):  # loops whose bins all differ: each would have a likelihood of its own to be factorised
        grid = grid[:1]
    unit = {size: np.eye(size) for size in {series.size for series in period_differences}}
    for series in period_differences:
        contrasts = unit[series.size]
        groups.setdefault(id(contrasts), (contrasts, []))[1].append(np.clip(series, -SPIKE, SPIKE))
    logs, variances = [], []
    for number, correlation in enumerate(grid):
        likelihood, variance = _restricted_likelihood(correlation, groups)
        off = abs(float(np.log(correlation.variance_inflation / expected.variance_inflation)))
        logs.append(likelihood - (0.0 if number == 0 else price) - INFLATION_PRICE * off)
        variances.append(variance)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    decays = np.array([correlation.decay for correlation in grid])
    neighbours = np.array([correlation.share for correlation in grid]) * decays
    scale = float(np.sqrt(weights @ np.array(variances)))
    return Correlation.of_neighbours(float(weights @ neighbours), float(weights @ (neighbours * decays))), scale


def _restricted_likelihood(
    correlation: Correlation, groups: dict[int, tuple[FloatArray, list[FloatArray]]]
) -> tuple[float, float]:
    """log L [nats] of a correlation at the variance s² that suits it best, and that variance."""
    squares, logdet, free = 0.0, 0.0, 0
    for contrasts, series in groups.values():
        distance = np.abs(np.subtract.outer(np.arange(contrasts.shape[0]), np.arange(contrasts.shape[0])))
        matrix = correlation.share * correlation.decay**distance
        np.fill_diagonal(matrix, 1.0)
        factor = np.linalg.cholesky(contrasts.T @ matrix @ contrasts)
        white = np.linalg.solve(factor, contrasts.T @ np.stack(series, axis=1))
        squares += float((white**2).sum())
        logdet += len(series) * 2 * float(np.log(np.diag(factor)).sum())
        free += white.size
    variance = squares / free
    return -0.5 * (free * np.log(variance) + logdet), variance
