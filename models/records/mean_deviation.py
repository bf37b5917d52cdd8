"""The deviation of a mean over autocorrelated noise: Var(mean) = s²/n [1 + 2 Σ (1 - k/n) ρ(k)].

The correlation ρ is estimated from all dwells of a record together, up to 2.5 times its own integrated time (Sokal's
window) and without the bias that removing a mean and a trend from each dwell causes. A dwell may have another one: its
batch means show it, and are followed as far as dwells differ by more than batch means scatter (Smyth's moderation of
variances). Where ρ has not faded within the dwells its tail is that of `models.records.slow_noise`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import digamma, polygamma

from models.arrays import FloatArray
from models.records import criteria
from models.records.slow_noise import slow_correlation


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A stretch of a record: time [m] s from its start, torque [m] Nm, averages that follow one another."""

    time: FloatArray
    torque: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """ρ at lags 1, 2, ... [m]; resolved is false where it had not faded at the longest lag that dwells can show: then it is
    that of `models.records.slow_noise`."""

    lags: FloatArray
    resolved: bool = True

    def factor(self, count: int) -> float:
        """The variance of a mean over `count` values over that of as many independent ones."""
        lag = np.arange(1, self.lags.size + 1)
        # anticorrelated noise averages out faster, but no further than this
        return max(float(1 + 2 * (np.maximum(1 - lag / count, 0.0) * self.lags).sum()), 0.2)


def pooled_correlation(residuals: Sequence[FloatArray], removed: int) -> Correlation:
    """ρ of all residuals together, each of which `removed` coefficients of low frequency were fitted to."""
    length = float(np.median([residual.size for residual in residuals]))
    longest = max(1, min(400, int(criteria.LOST_SHARE * length / (2 * removed))))  # averages
    total, count = np.zeros(longest + 1), np.zeros(longest + 1)
    for residual in residuals:
        power = float(residual @ residual)
        if residual.size <= longest or power == 0.0:
            continue
        padded = np.fft.rfft(residual, 1 << int(residual.size + longest).bit_length())
        products = np.fft.irfft(padded.real**2 + padded.imag**2)[: longest + 1]
        total += products * (residual.size / power)
        count += residual.size - np.arange(longest + 1)
    if count[0] == 0.0:
        return Correlation(lags=np.zeros(0))
    covariance = total / count
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
        return Correlation(lags=lags)
    return Correlation(lags=slow_correlation(residuals), resolved=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanDeviations:
    """One row a dwell: of its mean [n] Nm, its drift [n] Nm/s, the drift's deviation [n] Nm/s, of an average [n] Nm.

    resolved is false where noise is autocorrelated over longer times than a dwell: its correlation is then modelled.
    """

    mean: FloatArray
    drift: FloatArray
    drift_sd: FloatArray
    average: FloatArray
    resolved: bool


def deviations(stretches: Sequence[Stretch]) -> MeanDeviations:
    """The deviation of the mean of every stretch."""
    slopes, squares, residuals = [], [], []
    for stretch in stretches:
        centred = stretch.time - stretch.time.mean()
        square = max(float(centred @ centred), 1e-12)
        slope = float(centred @ stretch.torque) / square
        residuals.append(stretch.torque - stretch.torque.mean() - slope * centred)
        slopes.append(slope)
        squares.append(square)
    correlation = pooled_correlation(residuals, removed=2)
    rows = [_moments(residual, correlation) for residual in residuals]
    variance, factor, ratio, freedom = np.array(rows).T
    if not correlation.resolved and variance.any():  # few independent values hardly determine a variance
        independent = np.maximum(np.array([residual.size for residual in residuals]) / factor - 2, 1.0)
        variance = variance.mean() * _moderated(variance / variance.mean(), independent)
    long_run = variance * factor * _moderated(ratio, freedom)
    count = np.array([residual.size for residual in residuals])
    return MeanDeviations(
        mean=np.sqrt(long_run / count),
        drift=np.array(slopes),
        drift_sd=np.sqrt(long_run / np.array(squares)),
        average=np.sqrt(variance),
        resolved=correlation.resolved,
    )


def _moments(residual: FloatArray, correlation: Correlation) -> tuple[float, float, float, float]:
    """Variance of an average, the factor of its mean, batch means' variance over that by the factor, degrees of freedom."""
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
    """Each dwell's own ratio [n], shrunk towards 1 by as much as ratios scatter by chance (G. Smyth 2004)."""
    if ratio.size < 8:
        return np.ones_like(ratio)
    log_ratio = np.log(np.maximum(ratio, 1e-6)) - digamma(freedom / 2) + np.log(freedom / 2)
    excess = float(log_ratio.var(ddof=1) - polygamma(1, freedom / 2).mean())
    if excess <= 0:
        return np.ones_like(ratio)
    prior = (1 + np.sqrt(1 + 2 * excess)) / excess  # degrees of freedom: trigamma(prior / 2) = excess
    return np.asarray((prior + freedom * ratio) / (prior + freedom))
