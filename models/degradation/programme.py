"""Planned duty: a programme of blocks of cycles that is run over and over, each block with a severity of its own.

ζ goes on through a block at the rate (w/w_ref)^q a cycle (`severity`), with w the work that a cycle of the block is planned
to do. What is planned is not what is run: the work of a block may be uncertain, and is then log-normal with the stated mean
and standard deviation, the same at every pass of the programme.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Programme:
    """Blocks of `cycles` [b] > 0, and what a cycle of each adds to ζ [n, b] > 0, by draw.

    Raises ValueError where there is no block or a number is not positive.
    """

    cycles: FloatArray
    rates: FloatArray

    def __post_init__(self) -> None:
        if not (self.cycles.size and (self.cycles > 0.0).all() and (self.rates > 0.0).all()):
            raise ValueError("a programme needs a block, and all its cycles and rates must be positive")

    def cycles_until(self, progress: FloatArray) -> FloatArray:
        """The cycles [n] after which ζ has gone on by `progress` [n] >= 0; inf where that is."""
        steps = self.rates * self.cycles
        ends = np.cumsum(steps, axis=1)
        reached = np.isfinite(progress)
        finite = np.where(reached, progress, 0.0)
        passes = np.floor(finite / ends[:, -1])
        rest = np.maximum(finite - passes * ends[:, -1], 0.0)
        block = np.minimum((ends <= rest[:, None]).sum(axis=1), self.cycles.size - 1)
        draws = np.arange(rest.size)
        into = np.clip((rest - ends[draws, block]) / steps[draws, block] + 1.0, 0.0, 1.0)
        begun = np.concatenate([[0.0], np.cumsum(self.cycles)])
        return np.where(reached, passes * begun[-1] + begun[block] + into * self.cycles[block], np.inf)

    def blocks_in(self, cycles: float) -> float:
        """The blocks that so many cycles >= 0 are, the last one in part."""
        ends = np.concatenate([[0.0], np.cumsum(self.cycles)])
        passes, rest = divmod(cycles, float(ends[-1]))
        return passes * self.cycles.size + float(np.interp(rest, ends, np.arange(ends.size)))


def uncertain_work(mean: FloatArray | float, deviation: float, normals: FloatArray) -> FloatArray:
    """Log-normal work [n] of a mean > 0, [n] or the same for all, and a deviation >= 0, both in its unit, by normals [n]."""
    spread = np.log1p(np.square(deviation / np.asarray(mean)))
    return np.asarray(mean * np.exp(np.sqrt(spread) * normals - 0.5 * spread))
