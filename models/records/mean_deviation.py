"""The deviation of a mean over autocorrelated noise: Var(mean) = s²/n [1 + 2 Σ (1 - k/n) ρ(k)].

The correlation ρ is estimated from all dwells of a record together, up to 2.5 times its own integrated time (Sokal's
window) and without the bias that removing a mean and a trend from each dwell causes. A dwell may have another one: its
batch means show it, and are followed as far as dwells differ by more than batch means scatter (Smyth's moderation of
variances). Where ρ has not faded within the dwells its tail follows from the likelihood of all dwells of a record: a sum
of lagged products stops at the longest lag that a dwell can show. Beyond that the noise is assumed to be a white part and
a slow one, ρ(k) = a e^{-k/T} at lags k >= 1. The likelihood of a and T is the restricted one, of the residuals of each
dwell from its mean and its trend (H. D. Patterson, R. Thompson, Biometrika 58, 1971), over a grid, each dwell with a
deviation of its own; ρ is averaged over that grid with a uniform prior. So where the dwells do not determine T, the longer
values that they allow count too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular, toeplitz
from scipy.special import digamma, polygamma

from models.arrays import FloatArray
from models.records import criteria


def slow_correlation(residuals: Sequence[FloatArray], most: int = 64) -> FloatArray:
    """Autocorrelation ρ at lags 1, 2, ... by restricted likelihood of a white and a slow noise, up to the longest of
    residuals, each [m] free of mean and trend and of one clock.

    At `most` so many averages of each are used. Empty where none of them has as many as eight.
    """
    longest = max(residual.size for residual in residuals)
    group = -(-longest // most)
    means = [residual[: residual.size // group * group].reshape(-1, group).mean(axis=1) for residual in residuals]
    usable = [k for k, average in enumerate(means) if average.size >= 8 and float(average @ average) > 0]
    if not usable:
        return np.zeros(0)
    size = np.array([means[k].size for k in usable])
    table = np.zeros((int(size.max()), len(usable)))
    for column, k in enumerate(usable):
        table[: size[column], column] = means[k]
    # of correlation times and of shares of the variance all are equally probable
    times = np.geomspace(0.5 * group, 2.0 * longest, 16)
    places = [(float(time), share) for time in times for share in (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 1.0)]
    restricted = [_restricted(table, size, _averaged(time, group, table.shape[0]), share) for time, share in places]
    fit = np.array([row[0] for row in restricted])
    weight = np.exp(fit - fit.max())
    weight /= weight.sum()
    lost = sum(
        float(residuals[k] @ residuals[k]) / residuals[k].size - float(means[k] @ means[k]) / means[k].size
        for k in usable
    )
    lag = np.arange(1, longest)
    correlation = np.zeros(lag.size)
    for (time, share), (_, scale, variance), part in zip(places, restricted, weight, strict=True):
        if part > 1e-9:
            # averaging takes off the white part what the averages' mean squares have less than those of all
            correlation += part * share * scale / (variance + lost / len(usable)) * np.exp(-lag / time)
    return correlation


def _averaged(time: float, group: int, size: int) -> FloatArray:
    """Covariances [size] of averages over `group` values of slow noise with variance 1 and correlation time `time`."""
    inner = np.arange(1, group)
    within = (1 + 2 * float(((1 - inner / group) * np.exp(-inner / time)).sum())) / group
    step = np.exp(-np.arange(group) / time).mean() * np.exp(np.arange(group) / time).mean()
    return np.concatenate([[within], step * np.exp(-group * np.arange(1, size) / time)])


def _restricted(
    table: FloatArray, size: NDArray[np.intp], slow: FloatArray, share: float
) -> tuple[float, float, float]:
    """Restricted log likelihood of the columns of `table` [N, d], each of its own size [d], for noise with a share
    `share` of slow covariance `slow` [N] and a white rest; the average scale of the covariance, and the variance at
    that scale."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A stretch of a record: time [m] s from its start, torque [m] Nm, averages that follow one another."""

    time: FloatArray
    torque: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class DwellAutocorrelation:
    """Autocorrelation ρ of dwells at lags 1, 2, ... [m]; resolved is false where it had not faded at the longest lag
    that dwells can show: then it is that of `slow_correlation`."""

    lags: FloatArray
    resolved: bool = True

    def factor(self, count: int) -> float:
        """Variance inflation of a mean over `count` values: its variance over that of as many independent ones."""
        lag = np.arange(1, self.lags.size + 1)
        # anticorrelated noise averages out faster, but no further than this
        return max(float(1 + 2 * (np.maximum(1 - lag / count, 0.0) * self.lags).sum()), 0.2)


def _pooled_autocovariance(residuals: Sequence[FloatArray], longest: int) -> FloatArray | None:
    """Autocovariance [longest + 1] of residuals of unit variance at lags 0 ... longest, over all residuals that are longer
    than that; None where there are none."""
    total, count = np.zeros(longest + 1), np.zeros(longest + 1)
    for residual in residuals:
        power = float(residual @ residual)
        if residual.size <= longest or power == 0.0:
            continue
        padded = np.fft.rfft(residual, 1 << int(residual.size + longest).bit_length())
        products = np.fft.irfft(padded.real**2 + padded.imag**2)[: longest + 1]
        total += products * (residual.size / power)
        count += residual.size - np.arange(longest + 1)
    return None if count[0] == 0.0 else total / count


def pooled_correlation(residuals: Sequence[FloatArray], removed: int) -> DwellAutocorrelation:
    """Autocorrelation ρ of all residuals together, corrected for the `removed` coefficients of low frequency that were
    fitted to each."""
    length = float(np.median([residual.size for residual in residuals]))
    longest = max(1, min(400, int(criteria.LOST_SHARE * length / (2 * removed))))  # averages
    covariance = _pooled_autocovariance(residuals, longest)
    if covariance is None:
        return DwellAutocorrelation(lags=np.zeros(0))
    # What was removed takes `removed` Λ/n off every lag, Λ = γ_0 + 2 Σ γ_k being unknown: solved for each window.
    lag = np.arange(longest + 1)
    raw = covariance[0] + 2 * np.cumsum(np.where(lag > 0, covariance, 0.0))
    long_run = raw / np.maximum(1 - (1 + 2 * lag) * removed / length, 0.5 * (1 - criteria.LOST_SHARE))
    lost = removed * long_run / length
    times = np.maximum(long_run / (covariance[0] + lost), 1.0)
    enough = lag >= 2.5 * times
    window = int(enough.argmax()) if enough.any() else longest
    lags = (covariance[1 : window + 1] + lost[window]) / (covariance[0] + lost[window])
    if enough.any() or abs(float(lags[-1])) < 0.1:
        return DwellAutocorrelation(lags=lags)
    return DwellAutocorrelation(lags=slow_correlation(residuals), resolved=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanDeviations:
    """Standard deviations and drifts, one row a dwell: of its mean [n] Nm, its drift [n] Nm/s, the drift's deviation
    [n] Nm/s, of an average [n] Nm.

    resolved is false where noise is autocorrelated over longer times than a dwell: its correlation is then modelled.
    """

    mean: FloatArray
    drift: FloatArray
    drift_sd: FloatArray
    average: FloatArray
    resolved: bool


def deviations(stretches: Sequence[Stretch]) -> MeanDeviations:
    """Standard deviation of the mean of every stretch, with drifts."""
    slopes, squares, residuals = [], [], []
    for stretch in stretches:
        centred = stretch.time - stretch.time.mean()
        square = max(float(centred @ centred), 1e-12)
        slope = float(centred @ stretch.torque) / square
        residuals.append(stretch.torque - stretch.torque.mean() - slope * centred)
        slopes.append(slope)
        squares.append(square)
    correlation = pooled_correlation(residuals, removed=2)
    variance, factor, ratio, freedom = np.array(
        [_residual_statistics(residual, correlation) for residual in residuals]
    ).T
    count = np.array([residual.size for residual in residuals])
    if not correlation.resolved and variance.any():  # few independent values hardly determine a variance
        independent = np.maximum(count / factor - 2, 1.0)
        variance = variance.mean() * _moderated(variance / variance.mean(), independent)
    long_run = variance * factor * _moderated(ratio, freedom)
    return MeanDeviations(
        mean=np.sqrt(long_run / count),
        drift=np.array(slopes),
        drift_sd=np.sqrt(long_run / np.array(squares)),
        average=np.sqrt(variance),
        resolved=correlation.resolved,
    )


def _residual_statistics(residual: FloatArray, correlation: DwellAutocorrelation) -> tuple[float, float, float, float]:
    """Four statistics of a dwell's residual [n]: its variance; the variance inflation of its mean by the autocorrelation;
    the variance of means over batches, as a multiple of that expected by this inflation; and the degrees of freedom of
    this ratio (1 and 1 where there are fewer than four batches)."""
    size = residual.size
    factor = correlation.factor(size)
    variance = float(residual @ residual) / max(size - 2 * factor, 0.5 * size)
    length = max(1, size // 16, int(np.ceil(3.0 * factor)))
    batches = size // length
    if batches < 4 or variance == 0.0:
        return variance, factor, 1.0, 1.0
    means = residual[: batches * length].reshape(batches, length).mean(axis=1)
    expected = (batches - 2) * variance * correlation.factor(length) / length
    return variance, factor, float(means @ means) / expected, float(batches - 2)


def _moderated(ratio: FloatArray, freedom: FloatArray) -> FloatArray:
    """Variance ratios [n] of the dwells, shrunk towards 1 by as much as ratios scatter by chance (G. Smyth 2004)."""
    if ratio.size < 8:
        return np.ones_like(ratio)
    log_ratio = np.log(np.maximum(ratio, 1e-6)) - digamma(freedom / 2) + np.log(freedom / 2)
    excess = float(log_ratio.var(ddof=1) - polygamma(1, freedom / 2).mean())
    if excess <= 0:
        return np.ones_like(ratio)
    prior = (1 + np.sqrt(1 + 2 * excess)) / excess  # degrees of freedom: trigamma(prior / 2) = excess
    return np.asarray((prior + freedom * ratio) / (prior + freedom))
