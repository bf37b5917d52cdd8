"""The pressure gauge is off: the pressure at the clutch is not the recorded one."""

import math

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import (
    Discrepancy,
    Effect,
    Family,
    Kind,
    Measure,
    Shape,
    ShapeParameter,
    Tried,
)

#: Courses of the offset over life x = ζ/ζ_last, 1 at its end: constant, x^q, from a cycle on, or x (1 + s)/(x + s).
CONSTANT, GROWING, STEP, SETTLING = 0.0, 1.0, 2.0, 3.0
#: Powers q from which a fit starts, those between which a size is averaged, and values of s (chosen: so close that the size
#: moves by about its own deviation from one to the next).
STARTS, POWERS, SETTLED = (0.5, 1.0, 2.0), (0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 2.8), (0.1, 0.3, 1.0)


def _grid(facts: Facts) -> tuple[Tried, ...]:
    tried = [Tried(shape=(CONSTANT, 0.0, 0.0))]
    if facts.states.size > 2:
        tried += [Tried(shape=(GROWING, 0.0, math.log(power))) for power in STARTS]
        tried += _steps(facts)
    return tuple(tried)


def _courses(facts: Facts) -> tuple[Tried, ...]:
    tried = [Tried(shape=(CONSTANT, 0.0, 0.0))]
    if facts.states.size > 2:
        log_weight = math.log(len(STARTS) / (len(POWERS) + len(SETTLED)))
        tried += [Tried(shape=(GROWING, 0.0, math.log(power)), log_weight=log_weight) for power in POWERS]
        tried += [Tried(shape=(SETTLING, share, 0.0), log_weight=log_weight) for share in SETTLED]
        tried += _steps(facts)
    return tuple(tried)


def _steps(facts: Facts) -> list[Tried]:
    weight = -math.log(max(len(facts.onsets), 1))
    return [Tried(shape=(STEP, onset, 0.0), log_weight=weight) for _, onset, _ in facts.onsets]


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    course, value, log_power = shape
    cycles = scene.points.cycles
    life = np.maximum((cycles - scene.facts.states[0]) / scene.facts.life, 0.0)
    if course == CONSTANT:
        share = np.ones_like(cycles)
    elif course == GROWING:
        share = life ** math.exp(log_power)
    elif course == STEP:
        share = np.where(cycles > value, 1.0, 0.0)
    else:
        share = life * (1.0 + value) / (life + value)
    pressed = np.maximum(scene.points.pressure + amplitude * share, 0.0)  # nothing pulls the plates apart
    return np.asarray(scene.curve_at(pressure=pressed) - scene.curve, dtype=np.float64)


EFFECT = Effect(
    slug="pressure_offset",
    title="The pressure reading is off",
    physics="The pressure at the clutch differs from the gauge's reading; the torque changes as it does with pressure.",
    formula="S(p + a) - S(p), a constant, growing as (ζ/ζ_last)^q or towards an end, or from a cycle on",
    source="Ompusunggu et al. 2013, fig. 1: one gauge in the line, none at the piston",
    family=Family.SENSOR,
    kind=Kind.ARTEFACT,
    channels=(),
    amplitude="pressure offset",
    unit="bar",
    prior_sd=0.15e5,
    positive=False,
    scale=1e-5,
    shapes=(
        ShapeParameter(name="course", unit="-", lowest=0.0, highest=3.0),
        ShapeParameter(name="onset or s", unit="cycles or -", lowest=0.0, highest=float("inf")),
        ShapeParameter(
            name="log of the power q", unit="-", lowest=math.log(0.3), highest=math.log(3.0), smooth=True, held=True
        ),
    ),
    grid=_grid,
    courses=_courses,
    change=_change,
    grows_with=Measure.PRESSURE,
    before_lag=True,
    discrepancies=(Discrepancy.LIFE,),
)
