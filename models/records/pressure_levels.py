"""Levels of pressure: which measured pressures belong together, and the pressure [Pa] by which a level is called."""

import numpy as np

from models.arrays import FloatArray
from models.records.criteria import LEVEL_GAP, LEVEL_GAP_SHARE, LEVEL_STEP


def level_width(pressure: float) -> float:
    """How far apart [Pa] pressures of one level may lie at this pressure [Pa]: LEVEL_GAP, or its share if more."""
    return max(LEVEL_GAP, LEVEL_GAP_SHARE * pressure)


def levels_of(pressure: FloatArray) -> FloatArray:
    """The level [n] Pa of each measured pressure [n] Pa: equal values, same level.

    Sorted pressures are cut where neighbours lie further apart than LEVEL_GAP (or LEVEL_GAP_SHARE); where every distinct
    value occurs in three rows or more, pressures are nominal already and each distinct value is a level.
    """
    distinct, inverse, counts = np.unique(pressure, return_inverse=True, return_counts=True)
    gaps = np.diff(distinct)
    if counts.min() >= 3:
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
    snapped = round(median / LEVEL_STEP) * LEVEL_STEP
    return snapped if snapped > 0 and abs(median - snapped) <= 0.02e5 else round(median, 1)
