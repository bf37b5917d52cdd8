"""Levels of pressure: which measured pressures belong together, and the pressure [Pa] by which a level is called; and where
the pressure of a record is constant: the stretches at one level, without the ramps to and from it.
"""

import bisect
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records.criteria import (
    LEVEL_GAP,
    LEVEL_GAP_SHARE,
    LEVEL_NAMES,
    LEVEL_STEP,
    MEDIAN_DURATION,
    NAMED_WITHIN,
    NAMED_WITHIN_SHARE,
    SHORTEST_STRETCH,
)
from models.records.outliers import leading, running_median
from models.records.periods import sample_interval


def level_width(pressure: float) -> float:
    """The largest distance [Pa] of pressures of one level at this pressure [Pa]: LEVEL_GAP, or its share if more."""
    return max(LEVEL_GAP, LEVEL_GAP_SHARE * pressure)


def levels_of(pressure: FloatArray) -> FloatArray:
    """The level [n] Pa of each measured pressure [n] Pa: equal values, same level.

    Sorted pressures are cut where neighbours lie further apart than LEVEL_GAP (or LEVEL_GAP_SHARE); where every distinct
    value occurs in three rows or more, and neighbours are a LEVEL_STEP apart, pressures are nominal already and each
    distinct value is a level.
    """
    distinct, inverse, counts = np.unique(pressure, return_inverse=True, return_counts=True)
    gaps = np.diff(distinct)
    rounding = 1e-6 * LEVEL_STEP
    if counts.min() >= 3 and (gaps >= LEVEL_STEP - rounding).all():
        group = np.arange(distinct.size)
    else:
        group = np.concatenate([[0], np.cumsum(gaps > np.maximum(LEVEL_GAP, LEVEL_GAP_SHARE * distinct[1:]))])
    ordered = np.repeat(distinct, counts)
    rows = np.bincount(group, weights=counts).astype(np.intp)
    first = np.cumsum(rows) - rows
    medians = 0.5 * (ordered[first + (rows - 1) // 2] + ordered[first + rows // 2])
    names = np.array([_rounded_level(median) for median in medians.tolist()])
    return np.asarray(names[group[inverse]], dtype=np.float64)


def _rounded_level(median: float) -> float:
    """The roundest pressure [Pa] within a gauge's error of the median, or the median itself."""
    near = max(NAMED_WITHIN, NAMED_WITHIN_SHARE * median)
    for step in LEVEL_NAMES:
        snapped = round(median / step) * step
        if snapped > 0 and abs(median - snapped) <= near:
            return snapped
    return round(median, 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureStretch:
    """Consecutive rows [start, stop) at one pressure [Pa] (their median)."""

    pressure: float
    start: int
    stop: int


def pressure_stretches(time: FloatArray, pressure: FloatArray) -> Iterator[PressureStretch]:
    """The stretches of time [n] s, ascending, in which pressure [n] Pa is constant, in their order.

    Medians over a quarter of a second that stay within `level_width` of their own median belong together: too few (ramps
    between levels give such groups) or a straight line are no stretch. Where pressure still moves towards the level or
    already away from it is cut off; what is left lasts as long as its medians are apart.
    """
    smooth = running_median(pressure, 5)
    block = np.floor((time - time[0]) / max(MEDIAN_DURATION, 5 * sample_interval(time))).astype(np.int64)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1, [time.size]])
    medians = _block_medians(smooth, block, edges)
    for first, end, level in _groups(medians):
        allowed = level_width(abs(level))
        if end - first < SHORTEST_STRETCH or _ramps(medians[first:end], allowed):
            continue
        start, stop = _rows_near(level, allowed, smooth, edges, first, end)
        start, stop = _without_ramps(smooth, start, stop, allowed)
        if time[stop - 1] - time[start] >= (SHORTEST_STRETCH - 1) * MEDIAN_DURATION:
            yield PressureStretch(pressure=float(np.median(pressure[start:stop])), start=start, stop=stop)


def _groups(medians: FloatArray) -> Iterator[tuple[int, int, float]]:
    """Groups of consecutive blocks [first, end) with their level [Pa]: each median [b] lies within one level's width of
    the running median of its group."""
    first = 0
    ordered: list[float] = []  # the medians [first, end), ascending
    for end in range(1, medians.size + 1):
        bisect.insort(ordered, float(medians[end - 1]))
        level = 0.5 * (ordered[(end - first - 1) // 2] + ordered[(end - first) // 2])
        if end == medians.size or abs(medians[end] - level) > level_width(abs(level)):
            yield first, end, level
            first, ordered = end, []


def _rows_near(
    level: float, allowed: float, smooth: FloatArray, edges: NDArray[np.intp], first: int, end: int
) -> tuple[int, int]:
    """Row range [start, stop) of the blocks [first, end) at a level: rows off the level at the edges of the first and
    the last block are cut off, adjoining rows near it in the blocks beside them are added."""
    near = np.abs(smooth - level) <= allowed
    lowest, highest = edges[max(first - 1, 0)], edges[min(end + 1, edges.size - 1)]
    inside_start, inside_stop = edges[first + 1], edges[end - 1]
    before = np.flatnonzero(~near[lowest:inside_start])
    after = np.flatnonzero(~near[inside_stop:highest])
    start = lowest + before[-1] + 1 if before.size else lowest
    stop = inside_stop + after[0] if after.size else highest
    return int(start), int(stop)


def _block_medians(values: FloatArray, block: NDArray[np.int64], edges: NDArray[np.int64]) -> FloatArray:
    """Median of values [n] in each block; `block` [n] is ascending and starts again at each edge."""
    ordered = values[np.lexsort((values, block))]
    first, count = edges[:-1], np.diff(edges)
    return np.asarray(0.5 * (ordered[first + (count - 1) // 2] + ordered[first + count // 2]), dtype=np.float64)


def _ramps(medians: FloatArray, gap: float) -> bool:
    """Whether medians [b] over equal times are a straight line across the gap."""
    if float(np.ptp(medians)) < 1.5 * gap:
        return False
    return abs(float(np.corrcoef(np.arange(medians.size), medians)[0, 1])) > 0.98


def _without_ramps(smooth: FloatArray, start: int, stop: int, gap: float) -> tuple[int, int]:
    """[start, stop) without the rows at its ends where pressure is off the level by more than its usual wander.

    Level and wander are those of the middle half, so that a pressure which wanders all the time keeps its ends. They are
    computed again after each cut: half of a long ramp may lie in the first middle.
    """
    for _ in range(6):
        quarter = (stop - start) // 4
        middle = smooth[start + quarter : stop - quarter]
        level = float(np.median(middle))
        wander = 1.4826 * float(np.median(np.abs(middle - level)))
        off = np.abs(smooth[start:stop] - level) > max(4.0 * wander, 0.05 * gap)
        before, after = leading(off), leading(off[::-1])
        if before + after == 0 or before + after >= off.size:
            break
        start, stop = start + before, stop - after
    return start, stop
