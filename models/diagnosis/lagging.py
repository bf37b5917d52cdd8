"""The GMS attractor law in its periodic state, linear in each loop.

    dM/dt = C (1 - M/S) = (S - M)/τ,   τ = S/C                               (models.lag)

Given τ at evenly spaced phases, M is the periodic solution R[S] of a linear relaxation (exact where S is linear in the
relaxation's own time between phases), and so are its sensitivities: a change δS of the stationary curve gives
δM = R[(M/S) δS], and a change of log C a relaxation of its own.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray

#: A curve below this share of its loop's largest value is no friction to be followed, and is lifted to it.
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """keep e^-x and mean_keep (1 - e^-x)/x of each step [l, k]; torque M [l, k] Nm; ratio M/S [l, k]; by_log_attractor
    ∂M/∂log C [l, k]."""

    keep: FloatArray
    mean_keep: FloatArray
    torque: FloatArray
    ratio: FloatArray
    by_log_attractor: FloatArray

    def follow(self, change: FloatArray) -> FloatArray:
        """R[(M/S) δS]: a change of the stationary curve [l, k, m] Nm as it shows in the loops' torque."""
        return _relaxed(self.keep, self.mean_keep, self.ratio[:, :, None] * change)


def lag_of(curve: FloatArray, attractor: FloatArray, angular_frequency: FloatArray) -> Lag:
    """For curves S [l, k] Nm at evenly spaced phases, attractors C [l, k] Nm/s > 0 and frequencies [l] rad/s."""
    strength = np.maximum(np.abs(curve), _LEAST_SHARE * np.abs(curve).max(axis=1, keepdims=True) + 1e-12)
    rate = np.clip(attractor / strength, 1e-9, 1e9)
    step = 2 * np.pi / (curve.shape[1] * angular_frequency[:, None])
    x = 0.5 * step * (rate + np.roll(rate, 1, axis=1))
    keep = np.exp(-x)
    tiny = x < 1e-4
    mean_keep = np.where(tiny, 1 - x / 2 + x * x / 6, -np.expm1(-x) / np.where(tiny, 1.0, x))
    torque = _relaxed(keep, mean_keep, curve[:, :, None])[:, :, 0]
    by_mean = keep - mean_keep  # x dm/dx of M_i = e^-x M_{i-1} + (1 - m) S_i + (m - e^-x) S_{i-1}
    gain = -x * keep * np.roll(torque, 1, axis=1) - by_mean * curve + (by_mean + x * keep) * np.roll(curve, 1, axis=1)
    behind = _periodic(keep, gain[:, :, None])[:, :, 0]
    return Lag(
        keep=keep,
        mean_keep=mean_keep,
        torque=torque,
        ratio=torque / np.copysign(strength, curve),
        by_log_attractor=behind,
    )


def _relaxed(keep: FloatArray, mean_keep: FloatArray, target: FloatArray) -> FloatArray:
    """R[target] for targets [l, k, m]."""
    gain = (1 - mean_keep)[:, :, None] * target
    gain += (mean_keep - keep)[:, :, None] * np.roll(target, 1, axis=1)
    return _periodic(keep, gain)


def _periodic(keep: FloatArray, gain: FloatArray) -> FloatArray:
    """The periodic y [l, k, m] of y_i = keep_i y_{i-1} + gain_i: once around from nothing, then what was missing."""
    out = np.empty_like(gain)
    before = np.zeros((gain.shape[0], gain.shape[2]))
    for i in range(gain.shape[1]):
        before = keep[:, i, None] * before + gain[:, i]
        out[:, i] = before
    left = np.cumprod(keep, axis=1)
    first = before / (1 - left[:, -1:])
    return np.asarray(out + left[:, :, None] * first[:, None, :], dtype=np.float64)
