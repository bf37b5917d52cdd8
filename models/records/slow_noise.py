"""Noise autocorrelated over longer times than a dwell shows: how much, by the likelihood of all dwells of a record.

A sum of lagged products (`mean_deviation`) stops at the longest lag that a dwell can show. Beyond that the noise is assumed
to be a white part and a slow one, ρ(k) = a e^{-k/T} at lags k >= 1. The likelihood of a and T is the restricted one, of
the residuals of each dwell from its mean and its trend (H. D. Patterson, R. Thompson, Biometrika 58, 1971), over a grid,
each dwell with a deviation of its own; ρ is averaged over that grid with a uniform prior. So where the dwells do not
determine T, the longer values that they allow count too.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular, toeplitz

from models.arrays import FloatArray

#: Averages of a dwell that are used, at most, and number of correlation times on the grid.
_MOST_AVERAGES, _TIMES = 64, 16


def slow_correlation(residuals: Sequence[FloatArray]) -> FloatArray:
    """ρ at lags 1, 2, ... up to the longest of residuals, each [m] free of mean and trend and of one clock.

    Empty where none of them has as many as eight averages.
    """
    longest = max(residual.size for residual in residuals)
    group = -(-longest // _MOST_AVERAGES)
    means = [residual[: residual.size // group * group].reshape(-1, group).mean(axis=1) for residual in residuals]
    kept = [k for k, average in enumerate(means) if average.size >= 8 and float(average @ average) > 0]
    if not kept:
        return np.zeros(0)
    size = np.array([means[k].size for k in kept])
    table = np.zeros((int(size.max()), len(kept)))
    for column, k in enumerate(kept):
        table[: size[column], column] = means[k]
    # of correlation times and of shares of the variance all are equally probable
    times = np.geomspace(0.5 * group, 2.0 * longest, _TIMES)
    places = [(float(time), share) for time in times for share in (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 1.0)]
    restricted = [_restricted(table, size, _averaged(time, group, table.shape[0]), share) for time, share in places]
    fit = np.array([row[0] for row in restricted])
    weight = np.exp(fit - fit.max())
    weight /= weight.sum()
    lost = sum(
        float(residuals[k] @ residuals[k]) / residuals[k].size - float(means[k] @ means[k]) / means[k].size
        for k in kept
    )
    lag = np.arange(1, longest)
    correlation = np.zeros(lag.size)
    for (time, share), (_, scale, variance), part in zip(places, restricted, weight, strict=True):
        if part > 1e-9:
            # averaging takes off the white part what the averages' mean squares have less than those of all
            correlation += part * share * scale / (variance + lost / len(kept)) * np.exp(-lag / time)
    return correlation


def _averaged(time: float, group: int, size: int) -> FloatArray:
    """Covariances [size] of means over `group` of slow noise of variance 1 and correlation time `time`."""
    inner = np.arange(1, group)
    within = (1 + 2 * float(((1 - inner / group) * np.exp(-inner / time)).sum())) / group
    step = np.exp(-np.arange(group) / time).mean() * np.exp(np.arange(group) / time).mean()
    return np.concatenate([[within], step * np.exp(-group * np.arange(1, size) / time)])


def _restricted(
    table: FloatArray, size: NDArray[np.intp], slow: FloatArray, share: float
) -> tuple[float, float, float]:
    """The restricted log likelihood of columns of `table` [N, d], each of its own size [d], under `share` of `slow` noise
    [N] and a rest that is white; what both are scaled by, and their variance then, on average.
    """
    covariance = share * slow
    covariance[0] += 1 - share
    factor = np.linalg.cholesky(toeplitz(covariance) + 1e-9 * np.eye(slow.size))
    lag = np.arange(slow.size)
    design = np.column_stack([np.ones(lag.size), lag / lag.size])
    white = solve_triangular(factor, np.column_stack([design, table]), lower=True)
    x, y = white[:, :2], white[:, 2:]
    # The first m rows are those of a dwell of m averages: sums up to each row serve dwells of every size.
    last = size - 1
    ranks = np.cumsum(np.log(np.diag(factor)))[last]
    ones, slant, cross = (np.cumsum(products)[last] for products in (x[:, 0] ** 2, x[:, 1] ** 2, x[:, 0] * x[:, 1]))
    column = np.arange(size.size)
    by_one, by_slant, square = (
        np.cumsum(products, axis=0)[last, column] for products in (x[:, :1] * y, x[:, 1:] * y, y**2)
    )
    gram = ones * slant - cross**2
    left = square - (slant * by_one**2 + ones * by_slant**2 - 2 * cross * by_one * by_slant) / gram
    left = np.maximum(left, 1e-12 * square + 1e-300)
    likelihood = -ranks - 0.5 * np.log(gram) - 0.5 * (size - 2) * np.log(left)
    scale = float((left / (size - 2)).mean())
    return float(likelihood.sum()), scale, scale * float(covariance[0])
