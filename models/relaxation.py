"""First-order lags, dy/dt = r(t) (x(t) - y), over whole courses at once.

With u = ∫ r dt and the target x linear in u between two places the step Δu is exact,

    y_i = k y_{i-1} + (1 - m) x_i + (m - k) x_{i-1},     k = e^-Δu,  m = (1 - e^-Δu)/Δu

and all steps of all courses are one system of two diagonals: nothing loops over time.
"""

import numpy as np
from scipy.linalg.lapack import dtbtrs

from models.arrays import FloatArray


def kept(step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Relaxation factors k and m of steps Δu >= 0, any shape."""
    keep, tiny = np.exp(-step), step < 1e-4
    return keep, np.where(tiny, 1 - step / 2 + step * step / 6, -np.expm1(-step) / np.where(tiny, 1.0, step))


def recursion(keep: FloatArray, gain: FloatArray) -> FloatArray:
    """Solution y of y_i = keep_i y_{i-1} + gain_i, y_0 = gain_0, along n, in the shape of the gain [..., n] or
    [..., n, m] for keep [..., n], whose first does not count."""
    if gain.size == 0:
        return gain  # LAPACK writes where nothing is
    bands = np.ones((2, keep.size))
    bands[1] = np.append(-keep[..., 1:], np.zeros((*keep.shape[:-1], 1)), axis=-1).ravel()
    solved, _ = dtbtrs(bands, gain.reshape(keep.size, -1), uplo="L", diag="U")
    return np.asarray(solved.reshape(gain.shape), dtype=np.float64)


def relax(time: FloatArray, rate: FloatArray, target: FloatArray, start: float | FloatArray) -> FloatArray:
    """Solution y [..., n] of dy/dt = rate (target - y), y = start at time[0]; rate [..., n] 1/s > 0, whose integral is
    taken by trapezoids, target [..., n]. Raises ValueError where time falls."""
    step = np.diff(time)
    if (step < 0).any():
        raise ValueError(f"time must not fall, but does at row {int((step < 0).argmax()) + 1}")
    rate, target = np.broadcast_arrays(rate, target)
    keep, mean_keep = kept(0.5 * step * (rate[..., 1:] + rate[..., :-1]))
    gain = target[..., 1:] * (1 - mean_keep) + target[..., :-1] * (mean_keep - keep)
    first = np.broadcast_to(np.asarray(start, dtype=np.float64), (*gain.shape[:-1], 1))
    return recursion(np.concatenate([first, keep], axis=-1), np.concatenate([first, gain], axis=-1))
