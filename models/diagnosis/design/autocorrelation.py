"""How neighbouring rows remember each other, as a process of the first order with white noise beside it.

correlation with the k-th neighbour = w ρ^k,     the same as of x_i = ρ x_{i-1} + s (e_i + θ e_{i-1})
"""

from dataclasses import dataclass

import numpy as np

#: A correlation of neighbours below is none; and limits of what is taken for a process.
_LEAST_CORRELATION, _LONGEST_STEP, _HALF = 0.02, 0.99, 0.49


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Of a row with the k-th after it, w ρ^k: a `share` w up to 1 is how much of the variance remembers, by `step` ρ [0, 1)
    a row; beyond, as far as a spectrum allows, neighbours have much in common and others nothing."""

    share: float = 0.0
    step: float = 0.0

    @staticmethod
    def of_neighbours(one: float, two: float) -> "Correlation":
        """With these correlations [-] of the first and the second neighbour, as far as there is such a process: no spectrum
        is negative anywhere, so w ρ is at most (1 + ρ)/2."""
        if one < _LEAST_CORRELATION:
            return Correlation()
        step = min(max(two / one, 1e-3), _LONGEST_STEP)
        return Correlation(share=min(one / step, _HALF * (1.0 + step) / step), step=step)


def arma(correlation: Correlation) -> tuple[float, float]:
    """(θ, s): the process with unit variance is x_i - ρ x_{i-1} = s (e_i + θ e_{i-1}), |θ| < 1."""
    rho, share = correlation.step, correlation.share
    zero = 1 + rho * rho - 2 * share * rho * rho  # autocovariances of x_i - ρ x_{i-1}
    one = -rho * (1 - share)
    if abs(one) < 1e-12:
        return 0.0, float(np.sqrt(max(zero, 1e-12)))
    half = zero / (2 * one)
    inverse = half + np.copysign(np.sqrt(max(half * half - 1, 0.0)), half)  # the root beyond 1, which does not cancel
    return float(1 / inverse), float(np.sqrt(max(one * inverse, 1e-12)))
