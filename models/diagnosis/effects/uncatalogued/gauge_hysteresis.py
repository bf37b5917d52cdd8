"""A pressure gauge, or a piston, whose error depends on whether pressure was last raised or lowered."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.axes import PRESSURE
from models.diagnosis.effects.effect import Shape
from models.diagnosis.effects.uncatalogued.direction import direction_if_both
from models.diagnosis.effects.uncatalogued.fault import no_shape, uncatalogued_fault


def _change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    pressure = scene.points.pressure
    return np.asarray(amplitude * (direction_if_both(scene, pressure) * pressure * scene.by_pressure), dtype=np.float64)


FAULT = uncatalogued_fault(
    slug="gauge_hysteresis",
    description="a pressure that depends on whether it was last raised or lowered",
    formula="± a p ∂S/∂p",
    axis=PRESSURE,
    grid=no_shape,
    change=_change,
)
