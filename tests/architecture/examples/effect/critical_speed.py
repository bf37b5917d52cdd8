"""Friction of the bearings rises where the shaft passes its critical speed."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Effect, EffectKind, Measure, Shape, ShapeParameter, Tried

#: Half the width of the resonance [m/s].
_WIDTH = 0.8


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(Tried(shape=(critical,)) for critical in (3.0, 6.0, 9.0))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    (critical,) = shape
    return np.asarray(amplitude / (1.0 + ((scene.points.velocity - critical) / _WIDTH) ** 2), dtype=np.float64)


CRITICAL_SPEED = Effect(
    slug="critical_speed",
    title="The shaft passes a critical speed",
    article="a",
    physics="Unbalance loads the bearings most at the critical speed: a torque that peaks there, whatever the pressure.",
    formula="a / (1 + ((v - v_c)/w)²), w = 0.8 m/s",
    source="made up for docs/explanation/architecture.md",
    kind=EffectKind.ARTEFACT,
    channels=(),
    amplitude="torque at the critical speed",
    unit="Nm",
    prior_sd=0.3,
    lowest=0.0,
    scale=1.0,
    shapes=(ShapeParameter(name="critical speed", unit="m/s", lowest=1.0, highest=12.0, smooth=True),),
    grid=_grid,
    change=_change,
    grows_with=Measure.TORQUE,
    before_lag=False,
    discrepancies=(),
)
