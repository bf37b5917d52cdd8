"""How far the samples of a dynamic record remember each other, and what that makes of the means in phase bins.

What is left of a loop's samples once its low harmonics are taken off has the autocorrelations r_1 and r_2; noise that is
partly white and partly remembers has r_k = w ρ^k. The means of n samples in a row, a bin each, have then

    variance ∝ n + 2 Σ_{d<n} (n - d) w ρ^d,    covariance k bins on ∝ w ρ^{(k-1) n + 1} ((1 - ρⁿ)/(1 - ρ))²

Samples say more of it than bins do: there are many of them. What turns sharply in a loop is no noise: samples next to
standstill are left out. Noise as slow as a bin is told a little too fast, for the harmonics take some of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.design.autocorrelation import Correlation
from models.records.periods import harmonics

#: Harmonics of a loop that are not taken for noise.
HARMONICS = 8
#: Samples slower than this share of the loop's highest speed are left out.
LEAST_SPEED = 0.08
#: Fewer samples to a bin say nothing that the bins do not say themselves.
FEWEST_TO_A_BIN = 4.0
#: Loops whose samples to a bin differ by less than this factor are taken together.
_ALIKE = 1.2


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
        known, n = Correlation.of_neighbours(self.one, self.two), self.to_a_bin
        step, all_on = known.step, known.step**n
        inside = step * (n - 1 - n * step + all_on) / (1 - step) ** 2
        first = known.share * step * ((1 - all_on) / (1 - step)) ** 2 / (n + 2 * known.share * inside)
        return first, first * all_on


def memory_of(torque: FloatArray, phase: FloatArray, used: NDArray[np.bool_], to_a_bin: float) -> Memory | None:
    """Of torque [n] Nm at phase [rad], where samples are `used`; None where they are too few or all alike."""
    if to_a_bin < FEWEST_TO_A_BIN or np.count_nonzero(used) < 8 * (2 * HARMONICS + 1):
        return None
    basis = np.column_stack([np.ones(int(used.sum())), harmonics(phase[used], HARMONICS)])
    known = np.linalg.solve(basis.T @ basis + 1e-9 * used.sum() * np.eye(basis.shape[1]), basis.T @ torque[used])
    left = np.zeros(torque.size)
    left[used] = torque[used] - basis @ known
    there = used.astype(np.float64)
    sums = [float(left[k:] @ left[: left.size - k]) for k in range(3)]
    counts = [float(there[k:] @ there[: there.size - k]) for k in range(3)]
    if not sums[0] > 0.0 or min(counts) <= 0.0:
        return None
    one, two = (sums[k] / counts[k] * counts[0] / sums[0] for k in (1, 2))
    return Memory(one=one, two=two, to_a_bin=to_a_bin)


def bins_remember(memories: Sequence[Memory | None]) -> tuple[float, float] | None:
    """Correlations [-] of neighbouring bins, and of those next but one, on the average over loops; None where most of the
    loops do not tell. Loops that were sampled alike share their autocorrelations."""
    known = [each for each in memories if each is not None]
    if 2 * len(known) <= len(memories) or not known:
        return None
    kinds: dict[int, list[Memory]] = {}
    for each in known:
        kinds.setdefault(round(np.log(each.to_a_bin) / np.log(_ALIKE)), []).append(each)
    told = []
    for alike in kinds.values():
        one, two, to_a_bin = (float(np.mean([getattr(each, name) for each in alike])) for name in Memory.__slots__)
        told += [Memory(one=one, two=two, to_a_bin=to_a_bin).of_bins()] * len(alike)
    first, second = np.mean(told, axis=0).tolist()
    return first, second
