"""First-order lags along plateaus, and the periods of loops, as several effects need them."""

from typing import Any

import numpy as np
from scipy.linalg import solve_banded

from models.arrays import FloatArray
from models.diagnosis.design.points import Points


def ends_of(target: FloatArray, keep: FloatArray) -> FloatArray:
    """What each plateau ends with [P], x_i = (1 - k_i) target_i + k_i x_{i-1}: plateaus follow each other."""
    bands = np.stack([np.ones(keep.size), np.append(-keep[1:], 0.0)])
    return np.asarray(solve_banded((1, 0), bands, (1.0 - keep) * target), dtype=np.float64)


def followed(target: FloatArray, points: Points, settling: float) -> FloatArray:
    """The mean over each plateau [P] of what approaches its target [P] in `settling` s, from what the one before left; loops
    stay as they are."""
    follows = np.flatnonzero(points.previous >= 0)  # each follows the point just before it
    before = points.previous[follows]
    ratio = np.maximum(points.clock[follows] - points.clock[before], 1e-6) / settling
    keep = np.zeros(points.previous.size)
    keep[follows] = np.exp(-ratio)
    out = target.copy()
    out[follows] += (ends_of(target, keep)[before] - target[follows]) * (1.0 - keep[follows]) / ratio
    return out


def phases_of(points: Points, looping: np.ndarray[Any, np.dtype[np.intp]]) -> int:
    """How many points a loop has; `looping` [n] are the indices of loops' points, loop after loop."""
    return int(np.flatnonzero(np.diff(points.loop[looping], append=-2))[0]) + 1
