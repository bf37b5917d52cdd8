"""Plateaus too short: each still remembers the torque of the one before."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.effect import Bend, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.facts import Facts
from models.diagnosis.laws import Scene

#: What is remembered: the torque before, or the speed before (the film's), at the same pressure or across a change too.
TORQUE, TORQUE_WITHIN, SPEED = 0.0, 1.0, 2.0


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(Tried(shape=(memory,)) for memory in (TORQUE, TORQUE_WITHIN, SPEED))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    points = scene.points
    previous = points.previous
    known = previous >= 0
    before = np.where(known, previous, 0)
    if shape[0] == SPEED:
        difference = scene.by_velocity * (points.velocity[before] - points.velocity)
        limit = np.abs(scene.curve)
        difference = np.clip(difference, -limit, limit)
    else:
        difference = scene.curve[before] - scene.curve
    if shape[0] != TORQUE:
        known = known & (np.abs(points.pressure[before] - points.pressure) < 0.02 * points.pressure)
    known = known & (points.engaged * points.engaged[before] > 0)  # what an open clutch drags is no friction's memory
    return np.asarray(amplitude * np.where(known, difference, 0.0), dtype=np.float64)


EFFECT = Effect(
    slug="unsettled_dwell",
    title="Plateaus were not settled",
    physics="Friction approaches its steady value exponentially after a step; what is read too early still holds a share "
    "of the plateau before.",
    formula="a (S_before - S), a = e^{-dwell/τ} averaged over what was read",
    source="Ompusunggu et al. 2013, section 2.3.3: 5 s a plateau; real transients in tests/real",
    family=Family.DWELL,
    kind=Kind.ARTEFACT,
    channels=(),
    amplitude="share of the plateau before",
    unit="%",
    prior_sd=0.05,
    positive=True,
    scale=100.0,
    shapes=(ShapeParameter(name="what is remembered", unit="-", lowest=0.0, highest=2.0),),
    grid=_grid,
    change=_change,
    before_lag=False,
    bends=(Bend.SPEED,),
)
