"""A gain of the torque sensor that drifts over a test, as while the sensor warms up."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.axes import CLOCK
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Shape, Tried
from models.diagnosis.effects.uncatalogued.criteria import DRIFT_TIME, SETTLING_TIMES
from models.diagnosis.effects.uncatalogued.fault import uncatalogued_fault

#: The first shape is the time constant [s], or 0 for a gain that grows evenly; the second 1 where loops show it too.
_EVENLY = 0.0


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(Tried(shape=(time, in_loops)) for time in (_EVENLY, *SETTLING_TIMES) for in_loops in (0.0, 1.0))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    time, in_loops = shape
    clock = np.maximum(scene.points.clock, 0.0)
    share = -np.expm1(-clock / time) if time > 0 else clock / DRIFT_TIME
    shown = scene.points.steady | (in_loops > 0)
    return np.asarray(amplitude * np.where(shown, share, 0.0) * scene.curve, dtype=np.float64)


FAULT = uncatalogued_fault(
    slug="gain_with_clock",
    description="a gain of the torque that drifts while a test lasts, as a sensor's does that warms up",
    formula="a S t/30 min, or a S (1 - e^{-t/τ})",
    axis=CLOCK,
    grid=_grid,
    change=_change,
    shapes=2,
)
