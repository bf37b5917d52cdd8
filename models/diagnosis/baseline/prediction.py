"""The pooled baseline: every run of a campaign predicted by one parameter vector.

    prediction = S(v; p, ζ) at plateaus,   the GMS attractor's periodic torque behind S in loops,
                 the open clutch's drag where there is no pressure

with derivatives in closed form. `pooled_fit.gauss_newton` fits it. The attractor law is linear in each loop,

    dM/dt = C (1 - M/S) = (S - M)/τ,   τ = S/C                               (models.loops.lag_laws)

Given τ at evenly spaced phases, M is the periodic solution R[S] of a linear relaxation (exact where S is linear in the
relaxation's own time between phases), and so are its sensitivities: a change δS of the stationary curve gives δM = R[(M/S)
δS], and a change of log C a relaxation of its own.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import (
    BLOCK,
    DRIFT,
    FALL,
    LOG_DECAY,
    OPEN_DRAG,
    POWERS,
    RAISED,
    RATIO,
    Frame,
    Laws,
    Scene,
    scene_of,
)
from models.diagnosis.design.design import Design
from models.diagnosis.design.loop_bins import PHASES
from models.relaxation import kept, recursion

#: A curve below this share of its loop's largest value is lifted to it: C/S must stay finite.
_LEAST_SHARE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """The lag of friction behind the stationary curve in loops [l] at phases [k]."""

    keep: FloatArray  # e^-x of each step [l, k]
    mean_keep: FloatArray  # (1 - e^-x)/x
    torque: FloatArray  # M [l, k] Nm
    ratio: FloatArray  # M/S
    by_log_attractor: FloatArray  # ∂M/∂log C

    def follow(self, change: FloatArray) -> FloatArray:
        """R[(M/S) δS]: the change of the loops' torque [l, k, m] Nm by a change of the stationary curve [l, k, m] Nm."""
        return _relaxed(self.keep, self.mean_keep, self.ratio[:, :, None] * change)


def lag_of(curve: FloatArray, attractor: FloatArray, angular_frequency: FloatArray) -> Lag:
    """The lag in loops with curves S [l, k] Nm at evenly spaced phases, attractors C [l, k] or [l, 1] Nm/s > 0,
    frequencies [l] rad/s."""
    strength = np.maximum(np.abs(curve), _LEAST_SHARE * np.abs(curve).max(axis=1, keepdims=True) + 1e-12)
    rate = np.clip(attractor / strength, 1e-9, 1e9)
    step = 2 * np.pi / (curve.shape[1] * angular_frequency[:, None])
    x = 0.5 * step * (rate + np.roll(rate, 1, axis=1))
    keep, mean_keep = kept(x)
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
    """The periodic solution R[target] [l, k, m] of the relaxation towards targets [l, k, m]."""
    share_here, before = (1 - mean_keep)[:, :, None], (mean_keep - keep)[:, :, None]
    return _periodic(keep, share_here * target + before * np.roll(target, 1, axis=1))


def _periodic(keep: FloatArray, gain: FloatArray) -> FloatArray:
    """The periodic solution y [l, k, m] of y_i = keep_i y_{i-1} + gain_i, keep [l, k], gain [l, k, m]: one turn from
    y = 0, then the share of its end that was missing at its start is added."""
    from_zero = recursion(keep, gain)
    left = np.cumprod(keep, axis=1)[:, :, None]
    return np.asarray(from_zero + left * (from_zero[:, -1:] / (1 - left[:, -1:])), dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Torque [N] Nm at the rows (folded), the scene at the points, and the loops' lag (None without loops)."""

    torque: FloatArray
    scene: Scene
    lag: Lag | None

    def change_at_rows(self, design: Design, change: FloatArray, *, before_lag: bool) -> FloatArray:
        """Change of torque at the rows, [N] or [N, m] Nm, from one at the points, [P] or [P, m] Nm. With `before_lag`
        it is a change of the stationary curve and goes through the loops' lag first."""
        if before_lag and self.lag is not None:
            change = change.copy()
            loops = change[design.plateaus :].reshape(design.loops, PHASES, -1)
            loops[:] = self.lag.follow(loops)
        return design.to_rows(change)

    def jacobian(self, design: Design, of_effects: FloatArray | None = None) -> FloatArray:
        """∂torque/∂θ [N, θ.size]. `of_effects` [N, 5]: how effects beside the baseline change with the four parameters and
        log C, which move everywhere by the same amount."""
        laws, rows = self.scene.laws, design.rows
        of_effects = np.zeros((rows.run.size, RAISED)) if of_effects is None else of_effects
        by_parameters = self.change_at_rows(design, self.scene.gradient, before_lag=True) + of_effects[:, :-1]
        # a loop has one pressure and one state: the parameters depend on θ at its rows as they do at its points
        _, slopes, by_fall = laws.with_gradient(rows.pressure, rows.cycles)
        columns = np.zeros((rows.run.size, laws.theta.size))
        columns[:, :LOG_DECAY] = (by_parameters[:, :, None] * slopes).reshape(-1, 4 * BLOCK)
        columns[:, FALL] = by_parameters[:, RATIO, None] * by_fall
        columns[:, OPEN_DRAG] = design.to_rows(self.scene.open_powers)
        if self.lag is not None:
            slowness = (
                design.to_rows(np.append(np.zeros(design.plateaus), self.lag.by_log_attractor)) + of_effects[:, -1]
            )
            looping = slice(design.plateaus, None)
            weights = laws.log_attractor(rows.pressure[looping], rows.cycles[looping])[1]
            columns[looping, DRIFT:-POWERS] = slowness[looping, None] * weights
        return columns


def frame_of(design: Design) -> Frame:
    """The frame of a design's laws."""
    pressures, looping = design.levels, design.closed[design.plateaus :]
    of_loops = np.unique(design.level[design.plateaus :][looping])
    return Frame(
        lowest=float(pressures[0]),
        highest=float(pressures[-1]),
        last=float(design.facts.states[-1]),
        loop_pressures=of_loops if of_loops.size or not design.loops else pressures[:1],
        reference_velocity=0.5 * float(design.rows.velocity[design.closed].max(initial=1e-3)),
    )


def predict(design: Design, laws: Laws, parameters: FloatArray | None = None) -> Prediction:
    """The predicted torque at every row; the laws' parameters at the points [P, 4] may be given."""
    scene = scene_of(laws, design.points, design.facts, parameters)
    at_points, lag = scene.curve, None
    if design.loops:
        start = design.plateaus
        points, first = design.points, slice(start, None, PHASES)
        attractor = np.exp(laws.log_attractor(points.pressure[first], points.cycles[first])[0])
        frequency = points.angular_frequency[first]
        lag = lag_of(scene.curve[start:].reshape(design.loops, PHASES), attractor[:, None], frequency)
        at_points = np.concatenate([scene.curve[:start], lag.torque.ravel()])
    at_points = at_points + scene.open_powers @ laws.theta[OPEN_DRAG]
    return Prediction(torque=design.to_rows(at_points), scene=scene, lag=lag)
