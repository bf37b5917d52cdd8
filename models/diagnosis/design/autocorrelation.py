"""Autocorrelation of neighbouring rows: a process of the first order with white noise beside it.

    correlation with the k-th neighbour = w ρ^k,     the same as of the ARMA(1, 1) x_i = ρ x_{i-1} + s (e_i + θ e_{i-1})

Samples of a dynamic record show it better than its phase bins, for they are many more. The residual of a loop's samples
about its low harmonics has the autocorrelations r_1 and r_2; noise that is partly white and partly autocorrelated has r_k =
w ρ^k. The means of n samples in a row, a bin each, then have

    variance ∝ n + 2 Σ_{d<n} (n - d) w ρ^d,    covariance k bins on ∝ w ρ^{(k-1) n + 1} ((1 - ρⁿ)/(1 - ρ))²

Samples next to standstill are left out: a loop turns sharply there, which is no noise. Noise as slow as a bin is estimated
a little too fast, for the harmonics absorb part of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.records.periods import harmonics


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation w ρ^k of a row with the k-th after it: `share` w is the part of the variance that is autocorrelated
    (up to 1), `decay` ρ [0, 1) the factor per row. A share beyond 1, as far as a spectrum allows, means that neighbours
    have much in common and other rows nothing."""

    share: float = 0.0
    decay: float = 0.0

    @staticmethod
    def of_neighbours(first: float, second: float) -> "Correlation":
        """The correlation with these values [-] for the first and the second neighbour, as far as there is such a
        process: no spectrum is negative anywhere, so w ρ is at most (1 + ρ)/2."""
        if first < 0.02:
            return Correlation()
        decay = min(max(second / first, 1e-3), 0.99)  # stationary and positive definite
        return Correlation(share=min(first / decay, 0.49 * (1.0 + decay) / decay), decay=decay)

    @property
    def variance_inflation(self) -> float:
        """Variance inflation [-] of slow noise: the spectral density at frequency 0 over the variance, 1 + 2 w
        ρ/(1 - ρ), which is 1 for independent neighbours."""
        return 1.0 + 2.0 * self.share * self.decay / (1.0 - self.decay)


def arma(correlation: Correlation) -> tuple[float, float]:
    """ARMA(1, 1) coefficients (θ, s) of the process of unit variance x_i - ρ x_{i-1} = s (e_i + θ e_{i-1}), |θ| < 1."""
    rho, share = correlation.decay, correlation.share
    # autocovariances at lags 0 and 1 of x_i - ρ x_{i-1}
    at_0 = 1 + rho * rho - 2 * share * rho * rho
    at_1 = -rho * (1 - share)
    if abs(at_1) < 1e-12:
        return 0.0, float(np.sqrt(max(at_0, 1e-12)))
    half = at_0 / (2 * at_1)
    inverse = half + np.copysign(np.sqrt(max(half * half - 1, 0.0)), half)  # the root beyond 1, which does not cancel
    return float(1 / inverse), float(np.sqrt(max(at_1 * inverse, 1e-12)))


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleAutocorrelation:
    """Autocorrelations of samples at lags one and two [-], and the number of samples in a row within one bin."""

    first: float
    second: float
    per_bin: float

    def of_bins(self) -> tuple[float, float]:
        """Correlations [-] of the means of neighbouring bins and of bins next but one."""
        if self.first <= 0.0 or self.second <= 0.0:
            return 0.0, 0.0
        samples, n = Correlation.of_neighbours(self.first, self.second), self.per_bin
        decay, over_bin = samples.decay, samples.decay**n
        inside = decay * (n - 1 - n * decay + over_bin) / (1 - decay) ** 2
        neighbour = samples.share * decay * ((1 - over_bin) / (1 - decay)) ** 2 / (n + 2 * samples.share * inside)
        return neighbour, neighbour * over_bin


def sample_autocorrelation(
    torque: FloatArray, phase: FloatArray, used: NDArray[np.bool_], per_bin: float
) -> SampleAutocorrelation | None:
    """Autocorrelation of torque [n] Nm at phase [n] rad about its harmonics, of the samples `used` [n]; None where they
    are too few or all alike."""
    # with fewer the bins themselves say as much
    if per_bin < 4.0 or np.count_nonzero(used) < 8 * (2 * criteria.SIGNAL_HARMONICS + 1):
        return None
    basis = np.column_stack([np.ones(int(used.sum())), harmonics(phase[used], criteria.SIGNAL_HARMONICS)])
    ridge = 1e-9 * used.sum() * np.eye(basis.shape[1])
    coefficients = np.linalg.solve(basis.T @ basis + ridge, basis.T @ torque[used])
    residual = np.zeros(torque.size)
    residual[used] = torque[used] - basis @ coefficients
    counted = used.astype(np.float64)
    sums = [float(residual[k:] @ residual[: residual.size - k]) for k in range(3)]
    counts = [float(counted[k:] @ counted[: counted.size - k]) for k in range(3)]
    if not sums[0] > 0.0 or min(counts) <= 0.0:
        return None
    first, second = (sums[k] / counts[k] * counts[0] / sums[0] for k in (1, 2))
    return SampleAutocorrelation(first=first, second=second, per_bin=per_bin)


def bin_autocorrelation(loops: Sequence[SampleAutocorrelation | None]) -> tuple[float, float] | None:
    """Correlations [-] of neighbouring bins, and of bins next but one, averaged over loops; None where most loops have
    no estimate. Loops that were sampled alike share their autocorrelations."""
    estimated = [loop for loop in loops if loop is not None]
    if 2 * len(estimated) <= len(loops) or not estimated:
        return None
    groups: dict[int, list[SampleAutocorrelation]] = {}
    for loop in estimated:
        groups.setdefault(round(np.log(loop.per_bin) / np.log(1.2)), []).append(loop)  # within a factor of 1.2
    correlations = []
    for alike in groups.values():
        first, second, per_bin = (
            float(np.mean([getattr(loop, name) for loop in alike])) for name in SampleAutocorrelation.__slots__
        )
        pooled = SampleAutocorrelation(first=first, second=second, per_bin=per_bin)
        correlations += [pooled.of_bins()] * len(alike)
    neighbour, next_but_one = np.mean(correlations, axis=0).tolist()
    return neighbour, next_but_one
