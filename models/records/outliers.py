"""Samples of a record that no fit should use: spikes."""

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records.criteria import NEIGHBOURS, OUTLIER, OUTLIER_SHARE


def inliers(residual: FloatArray, value: FloatArray) -> NDArray[np.bool_]:
    """Mask [n] of values [n], ordered in time, near the fit *or* near their neighbours' median: a spike is neither.

    Near is within OUTLIER deviations (from the median absolute one), or within OUTLIER_SHARE of the largest value. A
    cusp that the fit cannot follow stays in.
    """
    return near(residual, value) | beside(value)


def beside(value: FloatArray) -> NDArray[np.bool_]:
    """Mask [n] of values [n] near their neighbours' median."""
    return near(value - running_median(value, NEIGHBOURS), value)


def running_median(value: FloatArray, count: int) -> FloatArray:
    """Running median [n] over `count` values about each [n], or over as many as there are; its ends are taken to go
    on."""
    from scipy.ndimage import median_filter  # start-up time: what answers cuts no record

    return np.asarray(median_filter(value, size=min(count, value.size), mode="nearest"))


def near(off: FloatArray, value: FloatArray) -> NDArray[np.bool_]:
    """Mask [n] of values [n] whose distance `off` [n] from a fit or a median is no larger than usual."""
    distance = np.abs(off - np.median(off))
    share = OUTLIER_SHARE * float(np.abs(value).max())
    return np.asarray(distance <= max(OUTLIER * 1.4826 * float(np.median(distance)), share), dtype=np.bool_)


def leading(off: NDArray[np.bool_]) -> int:
    """Number of rows to cut at the beginning: up to the last that is `off` [n] together with most of the rows before
    it."""
    share = np.cumsum(off) / np.arange(1, off.size + 1)
    rows = np.flatnonzero(off & (share > 0.5))
    return int(rows[-1]) + 1 if rows.size else 0
