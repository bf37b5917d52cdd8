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


def phases_of(points: Points, looping: np.ndarray[Any, np.dtype[np.intp]]) -> int:
    """How many points a loop has; `looping` [n] are the indices of loops' points, loop after loop."""
    return int(np.flatnonzero(np.diff(points.loop[looping], append=-2))[0]) + 1
