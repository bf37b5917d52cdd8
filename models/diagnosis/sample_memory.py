"""How far the samples of a dynamic record remember each other, and what that makes of the means in phase bins.

What is left of a loop's samples once its low harmonics are taken off has the autocorrelations r_1 and r_2; noise that is
partly white and partly remembers has r_k = w ρ^k. The means of n samples in a row, a bin each, have then

    variance ∝ n + 2 Σ_{d<n} (n - d) w ρ^d,    covariance k bins on ∝ w ρ^{(k-1) n + 1} ((1 - ρⁿ)/(1 - ρ))²

Samples say that far better than bins do: there are many of them, and what is smooth in a loop hides little so close by.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.periods import harmonics

#: Harmonics of a loop that are not taken for noise.
HARMONICS = 8
#: Fewer samples to a bin say nothing that the bins do not say themselves.
FEWEST_TO_A_BIN = 4.0
_MOST = 0.98


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """Autocorrelations one and two samples on [-], and how many samples in a row fall into one bin."""

    one: float
    two: float
    to_a_bin: float

    def of_bins(self) -> tuple[float, float]:
        """Correlations [-] of the means in neighbouring bins and in those next but one."""
        if self.one <= 0.0 or self.two <= 0.0:
            return 0.0, 0.0
        step = min(self.two / self.one, _MOST)
        share = min(self.one / step, 1.0)
        n = self.to_a_bin
        lags = np.arange(1, int(np.ceil(n)))
        variance = n + 2 * float(((n - lags) * share * step**lags).sum())
        first = share * step * ((1 - step**n) / (1 - step)) ** 2 / variance
        return float(first), float(first * step**n)


def memory_of(torque: FloatArray, phase: FloatArray, used: NDArray[np.bool_], to_a_bin: float) -> Memory | None:
    """Of torque [n] Nm at phase [rad], where samples are `used`; None where they are too few."""
    if to_a_bin < FEWEST_TO_A_BIN or np.count_nonzero(used) < 8 * (2 * HARMONICS + 1):
        return None
    basis = np.column_stack([np.ones(int(used.sum())), harmonics(phase[used], HARMONICS)])
    left = np.zeros(torque.size)
    known = np.linalg.solve(basis.T @ basis + 1e-9 * used.sum() * np.eye(basis.shape[1]), basis.T @ torque[used])
    left[used] = torque[used] - basis @ known
    there = used.astype(np.float64)
    sums = [float(left[k:] @ left[: left.size - k]) for k in range(3)]
    counts = [float(there[k:] @ there[: there.size - k]) for k in range(3)]
    if not sums[0] > 0.0 or min(counts) <= 0.0:
        return None
    one, two = (sums[k] / counts[k] * counts[0] / sums[0] for k in (1, 2))
    return Memory(one=one, two=two, to_a_bin=to_a_bin)


def bins_remember(memories: list[Memory | None]) -> tuple[float, float] | None:
    """Correlations [-] of neighbouring bins, and of those next but one, on the average over loops; None where unknown."""
    known = [each for each in memories if each is not None]
    if 2 * len(known) <= len(memories) or not known:
        return None
    one, two = (float(np.mean([getattr(each, name) for each in known])) for name in ("one", "two"))
    told = np.mean([Memory(one=one, two=two, to_a_bin=each.to_a_bin).of_bins() for each in known], axis=0)
    return float(told[0]), float(told[1])
