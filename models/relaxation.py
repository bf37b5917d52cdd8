"""One first-order lag with a rate that varies, dy/dt = r(t) (x(t) - y), over a whole course at once."""

import numpy as np

from models.arrays import FloatArray


def relax(time: FloatArray, rate: FloatArray, target: FloatArray, start: float | FloatArray) -> FloatArray:
    """y [..., n] of dy/dt = rate (target - y), y = start at time[0]; rate [..., n] 1/s > 0, target [..., n].

    With u = ∫ rate dt (trapezoids) and the target linear in u in each step the step is exact; the recursion
    y_{i+1} = a_i y_i + b_i is solved by doubling, so that nothing loops over time.
    """
    step = np.diff(time)
    if (step < 0).any():
        raise ValueError(f"time must not fall, but does at row {int((step < 0).argmax()) + 1}")
    rate, target = np.broadcast_arrays(rate, target)
    x = 0.5 * step * (rate[..., 1:] + rate[..., :-1])
    keep = np.exp(-x)
    tiny = x < 1e-4
    mean_keep = np.where(tiny, 1 - x / 2 + x * x / 6, -np.expm1(-x) / np.where(tiny, 1.0, x))
    gain = target[..., 1:] * (1 - mean_keep) + target[..., :-1] * (mean_keep - keep)
    first = np.broadcast_to(np.asarray(start, dtype=np.float64), (*gain.shape[:-1], 1))
    gain[..., :1] += keep[..., :1] * first
    ahead = 1
    while ahead < gain.shape[-1]:
        gain[..., ahead:] = gain[..., ahead:] + keep[..., ahead:] * gain[..., :-ahead]
        keep[..., ahead:] = keep[..., ahead:] * keep[..., :-ahead]
        if not keep[..., ahead:].any():
            break
        ahead *= 2
    return np.concatenate([first, gain], axis=-1)
