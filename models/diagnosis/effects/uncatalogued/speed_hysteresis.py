"""A torque that depends on whether the speed was last raised or lowered."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.axes import SPEED
from models.diagnosis.effects.effect import Shape
from models.diagnosis.effects.uncatalogued.direction import direction_if_both
from models.diagnosis.effects.uncatalogued.fault import no_shape, uncatalogued_fault


def _change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    return np.asarray(amplitude * direction_if_both(scene, scene.points.velocity) * scene.curve, dtype=np.float64)


FAULT = uncatalogued_fault(
    slug="speed_hysteresis",
    description="a torque that depends on whether the speed was last raised or lowered",
    formula="± a S",
    axis=SPEED,
    grid=no_shape,
    change=_change,
)
