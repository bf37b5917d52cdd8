"""Plateaus too short: each reading still contains a share of the plateau before."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.effects.first_order_lag import ends_of

#: What a plateau starts from: the torque before, or the speed before (the film's), at the same pressure or across a change
#: too.
TORQUE, TORQUE_WITHIN, SPEED = 0.0, 1.0, 2.0
#: Of the share that is read, this much is still there at the dwell's end, to be carried on: all where only that is read.
CARRIED = 0.5


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(Tried(shape=(start, CARRIED)) for start in (TORQUE, TORQUE_WITHIN, SPEED))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    start, *carried = shape
    points = scene.points
    previous = points.previous
    follows = previous >= 0
    before = np.where(follows, previous, 0)
    if start != TORQUE:
        follows = follows & (np.abs(points.pressure[before] - points.pressure) < 0.02 * points.pressure)
    follows = follows & (
        points.engaged * points.engaged[before] > 0
    )  # an open clutch's drag is not carried over as friction
    if start == SPEED:
        difference = scene.by_velocity * (points.velocity[before] - points.velocity)
        limit = np.abs(scene.curve)
        difference = np.clip(difference, -limit, limit)
    else:
        share = float(np.clip(amplitude * (carried[0] if carried else 0.0), 0.0, 0.95))
        difference = ends_of(scene.curve, np.where(follows, share, 0.0))[before] - scene.curve
    return np.asarray(amplitude * np.where(follows, difference, 0.0), dtype=np.float64)


EFFECT = Effect(
    slug="unsettled_dwell",
    title="Plateaus were not settled",
    physics="Friction approaches its steady value exponentially after a step; a reading taken too early still contains a "
    "share of the plateau before.",
    formula="a (x_before - S), x = S + k a (x_before - S) what a plateau ends with; a = e^{-dwell/τ} averaged over what was "
    "read",
    source="Ompusunggu et al. 2013, section 2.3.3: 5 s a plateau; real transients in tests/real",
    family=Family.DWELL,
    kind=Kind.ARTEFACT,
    channels=(),
    amplitude="share of the plateau before",
    unit="%",
    prior_sd=0.05,
    positive=True,
    scale=100.0,
    shapes=(
        ShapeParameter(name="what a plateau starts from", unit="-", lowest=0.0, highest=2.0),
        ShapeParameter(name="of the share, what is carried on, k", unit="-", lowest=0.0, highest=1.0, smooth=True),
    ),
    grid=_grid,
    change=_change,
    before_lag=False,
    discrepancies=(Discrepancy.SPEED,),
)
