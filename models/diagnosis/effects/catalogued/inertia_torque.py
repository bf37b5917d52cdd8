"""Rotating mass between clutch and torque sensor."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Effect, Family, Kind, Measure, Shape, Tried


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return (Tried(shape=()),)


def _change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    return np.asarray(amplitude * scene.points.acceleration / scene.facts.geometry.mean_radius, dtype=np.float64)


EFFECT = Effect(
    slug="inertia_torque",
    title="Inertia is in the measured torque",
    physics="A mass between clutch and sensor turns with the shaft: the sensor also measures the torque that "
    "accelerates it.",
    formula="J dω/dt",
    source="Newton; on the reference's rig the sensor stands on the grounded side, on others it does not",
    family=Family.DYNAMIC,
    kind=Kind.LAG,
    channels=("time_s",),
    amplitude="moment of inertia",
    unit="kg m²",
    prior_sd=0.004,
    positive=True,
    scale=1.0,
    shapes=(),
    grid=_grid,
    change=_change,
    grows_with=Measure.TORQUE,
    before_lag=False,
    discrepancies=(),
)
