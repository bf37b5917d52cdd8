"""Autocorrelation of neighbouring rows: a process of the first order with white noise beside it.

correlation with the k-th neighbour = w ρ^k,     the same as of the ARMA(1, 1) x_i = ρ x_{i-1} + s (e_i + θ e_{i-1})
"""

from dataclasses import dataclass

import numpy as np

from models.diagnosis.design.criteria import LEAST_CORRELATION

#: Bounds that keep the process stationary and its covariance positive definite.
_LEAST_DECAY, _MOST_DECAY, _HALF = 1e-3, 0.99, 0.49


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation of a row with the k-th after it, w ρ^k: `share` w is the part of the variance that is autocorrelated
    (up to 1), `decay` ρ [0, 1) the factor per row. Beyond 1, as far as a spectrum allows, neighbours have much in common and
    other rows nothing."""

    share: float = 0.0
    decay: float = 0.0

    @staticmethod
    def of_neighbours(first: float, second: float) -> "Correlation":
        """With these correlations [-] of the first and the second neighbour, as far as there is such a process: no spectrum
        is negative anywhere, so w ρ is at most (1 + ρ)/2."""
        if first < LEAST_CORRELATION:
            return Correlation()
        decay = min(max(second / first, _LEAST_DECAY), _MOST_DECAY)
        return Correlation(share=min(first / decay, _HALF * (1.0 + decay) / decay), decay=decay)

    @property
    def variance_inflation(self) -> float:
        """How much stronger slow noise is than with independent neighbours [-]: the spectral density at frequency 0 over the
        variance, 1 + 2 w ρ/(1 - ρ)."""
        return 1.0 + 2.0 * self.share * self.decay / (1.0 - self.decay)


def arma(correlation: Correlation) -> tuple[float, float]:
    """(θ, s): the process with unit variance is x_i - ρ x_{i-1} = s (e_i + θ e_{i-1}), |θ| < 1."""
    rho, share = correlation.decay, correlation.share
    # autocovariances at lags 0 and 1 of x_i - ρ x_{i-1}
    at_0 = 1 + rho * rho - 2 * share * rho * rho
    at_1 = -rho * (1 - share)
    if abs(at_1) < 1e-12:
        return 0.0, float(np.sqrt(max(at_0, 1e-12)))
    half = at_0 / (2 * at_1)
    inverse = half + np.copysign(np.sqrt(max(half * half - 1, 0.0)), half)  # the root beyond 1, which does not cancel
    return float(1 / inverse), float(np.sqrt(max(at_1 * inverse, 1e-12)))
