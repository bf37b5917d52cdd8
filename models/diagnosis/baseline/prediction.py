"""The pooled baseline: every run of a campaign predicted by one parameter vector.

    prediction = S(v; p, ζ) at plateaus,   the GMS attractor's periodic torque behind S in loops,
                 the open clutch's drag where there is no pressure

with derivatives in closed form. `pooled_fit.gauss_newton` fits it.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.attractor import Lag, lag_of
from models.diagnosis.baseline.laws import (
    BLOCK,
    DRIFT,
    FALL,
    LOG_DECAY,
    OPEN_DRAG,
    POWERS,
    RATIO,
    Frame,
    Laws,
    Scene,
    scene_of,
)
from models.diagnosis.design.design import Design
from models.diagnosis.design.loop_bins import PHASES


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Torque [N] Nm at the rows (folded), the scene at the points, and the loops' lag (None without loops)."""

    torque: FloatArray
    scene: Scene
    lag: Lag | None

    def change_at_rows(self, design: Design, change: FloatArray, *, before_lag: bool) -> FloatArray:
        """A change [P] or [P, m] Nm at the points -> [N] or [N, m] at the rows; what changes the stationary curve goes
        through the loops' lag first."""
        return design.to_rows(self._lagged(design, change) if before_lag else change)

    def _lagged(self, design: Design, change: FloatArray) -> FloatArray:
        if self.lag is None:
            return change
        out = change.copy()
        loops = out[design.plateaus :].reshape(design.loops, PHASES, -1)
        loops[:] = self.lag.follow(loops)
        return out

    def jacobian(self, design: Design) -> FloatArray:
        """∂torque/∂θ [N, θ.size]."""
        laws, rows = self.scene.laws, design.rows
        by_parameters = self.change_at_rows(design, self.scene.gradient, before_lag=True)
        # a loop has one pressure and one state: the parameters depend on θ at its rows as they do at its points
        _, slopes, by_fall = laws.with_gradient(rows.pressure, rows.cycles)
        columns = np.zeros((rows.run.size, laws.theta.size))
        columns[:, :LOG_DECAY] = (by_parameters[:, :, None] * slopes).reshape(-1, 4 * BLOCK)
        columns[:, FALL] = by_parameters[:, RATIO, None] * by_fall
        columns[:, OPEN_DRAG] = design.to_rows(self.scene.open_powers)
        if self.lag is not None:
            slowness = design.to_rows(np.append(np.zeros(design.plateaus), self.lag.by_log_attractor))
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


def predict(design: Design, laws: Laws) -> Prediction:
    """The torque at every row by the laws."""
    scene = scene_of(laws, design.points, design.facts)
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
