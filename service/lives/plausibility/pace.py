"""How probable a number of cycles is after those that are known of a clutch.

    P(n) = Σ w_k P_k(n) / Σ w_k

over ways in which the next run comes about: at known cycles where its kind is still to come, at the end of a block that
begins where another ended or that is one of equal blocks from the start, after the gap that was between runs before or one
like it, late among those known, or anywhere.
Runs come in any order and gaps of every size are honest: each way has its share, and none is zero.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.arrays import FloatArray
from models.degradation.general_order import Number
from service.lives.history import Event
from service.lives.plausibility import criteria

RUN_IN = "run_in"


@dataclass(frozen=True, kw_only=True)
class Pace:
    """The known cycles [n] of a clutch and those [m] of the next run's kind, both ascending and distinct.

    `block` is the duty cycles that the next run says it ran, None for no block. What does not hang on the next run's own
    cycles is worked out once: a dozen other readings of these are weighed.
    """

    cycles: FloatArray
    of_kind: FloatArray
    block: float | None

    def log_probability(self, cycles: float) -> float:
        """log P that the next run is made at `cycles`."""
        ways = [(criteria.ANYWHERE, anywhere(cycles)), *self._after_gap(cycles)]
        if self.block is not None:
            ways.append((criteria.BLOCKS, self._blocks(cycles, self.block)))
        if self.cycles.size == 0:
            ways.append((criteria.JOINS_LATEST, float(_equal(cycles, self.block or 0.0))))
        else:
            ways += [*self._joins(cycles), *self._tiles(cycles)]
            latest, late = float(self.cycles[-1]), 0.0
            if cycles <= latest:  # late: anywhere among the known, by the cycles or by their logarithm
                late = 0.5 / (1.0 + latest) + 0.5 / ((1.0 + cycles) * math.log1p(latest + 1.0))
            ways.append((criteria.LATE, late))
        total = math.fsum(weight for weight, _ in ways)
        return math.log(math.fsum(weight * probability for weight, probability in ways) / total)

    def expected(self) -> float:
        """The cycles at which a run that mistook its cycles was most likely made: one gap on."""
        if self.cycles.size == 0:
            return self.block or 0.0
        if self.block is not None:
            return float(self.cycles[-1]) + self.block
        return float(self.cycles[-1]) + (float(self._gaps[-1]) if self._gaps.size else 0.0)

    @property
    def usual_gap(self) -> float | None:
        """The median of the last gaps between runs of the kind, None where there was none."""
        return float(np.median(self._gaps[-5:])) if self._gaps.size else None

    @cached_property
    def _base(self) -> FloatArray:
        """The cycles that the next run's gap is counted from: those of its kind where there are two, else all."""
        return self.of_kind if self.of_kind.size > 1 else self.cycles

    @cached_property
    def _gaps(self) -> FloatArray:
        return np.diff(self._base)

    @cached_property
    def _to_come(self) -> FloatArray:
        """The known cycles at which a run of the next one's kind is still to come."""
        return self.cycles[~np.isin(self.cycles, self.of_kind)]

    @cached_property
    def _ends(self) -> FloatArray:
        """Where the next run's block would end if it began where another ended, or at the start, or if one as long that ends
        at a known run followed it."""
        block = self.block or 0.0
        ends = np.union1d(np.append(self.cycles, 0.0) + block, self.cycles - block)
        return ends[ends >= block]

    @cached_property
    def _like_gaps(self) -> tuple[float, FloatArray, FloatArray, FloatArray]:
        """The logarithm of the middle gap; how recent each gap is; the logarithms of gaps like them, and their shares."""
        gaps, last = self._gaps, float(self._base[-1]) if self._base.size else 0.0
        middle = math.log(float(np.median(gaps)) if gaps.size else max(last, 1_000.0))
        recency = np.power(0.7, np.arange(gaps.size, dtype=np.float64)[::-1])
        recency /= recency.sum() or 1.0
        centres, shares = np.log(gaps), recency
        if gaps.size > 1:  # gaps that grow by a factor, as in 10, 100, 1000
            centres = np.append(centres, 2 * centres[-1] - centres[-2])
            shares = np.append(0.8 * shares, 0.2)
        return middle, recency, centres, shares

    def _joins(self, cycles: float) -> list[tuple[float, float]]:
        made = _among(cycles, self.of_kind)
        ways = [(criteria.REPEATS_TEST, float(made) / max(self.of_kind.size, 1))]
        to_come = self._to_come
        if to_come.size:
            if to_come[-1] == self.cycles[-1]:
                ways.append((criteria.JOINS_LATEST, float(_equal(cycles, float(to_come[-1])))))
            ways.append((criteria.JOINS, float(_among(cycles, to_come)) / to_come.size))
        return ways

    def _tiles(self, cycles: float) -> list[tuple[float, float]]:
        if self.block is None:
            return []
        latest = float(_equal(cycles, float(self.cycles[-1]) + self.block))
        earlier = float(_among(cycles, self._ends)) / self._ends.size
        return [(criteria.TILES, latest), (criteria.TILES_EARLIER, earlier)]

    @staticmethod
    def _blocks(cycles: float, block: float) -> float:
        """Probability of the end of one of the equal blocks that fill a life from its start: any of them may come next."""
        is_end = block >= 1.0 and _equal(block * round(cycles / block), cycles)
        return min(block * anywhere(cycles), 1.0) if is_end else 0.0

    def _after_gap(self, cycles: float) -> list[tuple[float, float]]:
        gap = cycles - (float(self._base[-1]) if self._base.size else 0.0)
        middle, recency, centres, shares = self._like_gaps
        ways = [(criteria.OTHER_GAP, float(self._density(gap, middle, criteria.OTHER_GAP_SD)))]
        if self._gaps.size:
            ways.append((criteria.SAME_GAP, float(recency[np.abs(self._gaps - gap) < 0.5].sum())))
            ways.append((criteria.LIKE_GAP, float(shares @ self._density(gap, centres, criteria.LIKE_GAP_SD))))
        return ways

    @staticmethod
    def _density(gap: float, centre: Number, deviation: float) -> FloatArray:
        """Density a cycle of a gap whose logarithm is normal about `centre`, in its shape; 0 for no gap."""
        if gap < 0.5:
            return np.zeros_like(centre)
        z = (math.log(gap) - np.asarray(centre)) / deviation
        return np.asarray(np.exp(-0.5 * z * z) / (deviation * math.sqrt(2 * math.pi) * gap))


def pace_of(events: Sequence[Event], newest: Event) -> Pace:
    """The pace of the runs before, as the next of its kind is predicted from; run-in is before the first cycle."""
    return Pace(
        cycles=np.unique([event.cycles for event in events]),
        of_kind=np.unique([event.cycles for event in events if event.kind == newest.kind]),
        block=None if newest.duty is None or newest.kind == RUN_IN else newest.duty.cycles,
    )


def anywhere(cycles: float) -> float:
    """Probability of a number of cycles of which nothing is known: log(1 + n) is normal."""
    centre = math.log1p(criteria.CYCLES)
    return normal(math.log1p(cycles), centre, criteria.LOG_CYCLES_SD) / (1.0 + cycles)


def log_anywhere(cycles: float) -> float:
    """Its logarithm."""
    return math.log(anywhere(cycles))


def normal(value: float, mean: float, deviation: float) -> float:
    """The density of a normal."""
    z = (value - mean) / deviation
    return math.exp(-0.5 * z * z) / (deviation * math.sqrt(2 * math.pi))


def _equal(first: float, second: float) -> bool:
    return abs(first - second) < 0.5


def _among(cycles: float, others: FloatArray) -> bool:
    return bool((np.abs(others - cycles) < 0.5).any())
