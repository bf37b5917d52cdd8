"""Limits that end a life, and which of several is reached first.

A limit is a share of a quantity's value at ζ = 0, or a value that it falls below or rises above. Each draw of the quantity's
path reaches it at its own ζ, linear between the places where the path is computed. Of several limits the first to be
reached counts. Their draws are combined at random: given its own tests the error of one quantity's end is taken to be
independent of the others', for each limit looks at another quantity or another pressure.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.prognosis.first_passage import first_below, path_places
from models.tracking.sampling import systematic

#: Places of a path: evenly over what was measured, and then in equal ratios up to the horizon.
_BEHIND, _AHEAD = 40, 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Exactly one of: `fraction` of the initial value, a value `below` or `above` which the quantity may not get.

    Raises ValueError where none or several are given, or one is not finite, or fraction lies outside (0, 1).
    """

    fraction: float | None = None
    below: float | None = None
    above: float | None = None

    def __post_init__(self) -> None:
        given = [number for number in (self.fraction, self.below, self.above) if number is not None]
        if len(given) != 1 or not math.isfinite(given[0]):
            raise ValueError("exactly one of fraction, below and above must be given, and be finite")
        if self.fraction is not None and not 0.0 < self.fraction < 1.0:
            raise ValueError(f"fraction must lie between 0 and 1, got {self.fraction}")

    def level(self, initial: FloatArray | float) -> FloatArray:
        """The value at which the limit is reached, for an initial value of any shape."""
        if self.fraction is not None:
            return np.asarray(self.fraction * np.asarray(initial))
        fixed = self.below if self.below is not None else self.above
        return np.full(np.shape(initial), fixed)

    def passages(self, paths: FloatArray, progress: FloatArray) -> FloatArray:
        """The ζ [n] at which each path [k, n] over ascending progress [k] first comes to the limit; inf where it never does.

        A path that begins past its limit counts only after it has come back to the good side. One that never comes back is
        at the limit from the first ζ.
        """
        sign = -1.0 if self.above is not None else 1.0
        from_above, level = sign * paths, sign * self.level(paths[0])
        was_good = np.logical_or.accumulate(from_above > level, axis=0)
        return first_below(np.where(was_good | ~was_good[-1], from_above, np.inf), progress, level)


def places(now: float, horizon: float) -> FloatArray:
    """ζ [k] at which paths are computed: evenly up to `now` >= 0, where a life stands, and in equal ratios to `horizon`."""
    start = max(now, 1.0)
    return path_places(start, max(horizon, 2.0 * start), _BEHIND, _AHEAD)


def first_reached(
    ends: Sequence[tuple[FloatArray, FloatArray]], size: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """The first of several ends, `size` draws of equal weight, and the probability [c] of each to be that first.

    `ends` are weighted samples, each of ends [n] (inf: never) with weights [n] that sum to one. A draw in which none is
    ever reached counts for none. At least one is needed.
    """
    drawn = np.stack([rng.permutation(sample[systematic(weight, size, rng.random())]) for sample, weight in ends])
    first = drawn.min(axis=0)
    reached = np.isfinite(first)
    which = np.bincount(drawn.argmin(axis=0)[reached], minlength=len(ends))
    return first, which / size
