"""The torque sensor's zero moved: at once, along the test, or along the life."""

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

#: Courses of the zero: one offset from a cycle on, along the test's clock (straight, or settling), along the life by cycles
#: or by the days that it took.
STEP, CLOCK, SETTLING, LIFE, DAYS = 0.0, 1.0, 2.0, 3.0, 4.0
#: Between these too a size is averaged: x^q and x (1 + s)/(x + s) along the life, without knots that may be off, by cycles
#: or by days; their powers q, and s (chosen, with those of a pressure's offset).
EVEN, EVEN_DAYS, FLATTENING, FLATTENING_DAYS = 5.0, 6.0, 7.0, 8.0
POWERS, FLATTENED = (0.5, 0.7, 1.0, 1.4, 2.0), (0.1, 0.3, 1.0)
_HOUR = 3600.0
#: Times [s] after which a zero has settled to 1/e, each refined by the factor e^x, x the first of the knots below.
TIMES = (120.0, 400.0)
#: Knots over life at which a zero may be off its straight course, in amplitudes; on a straight course it is off by none.
KNOTS, STRAIGHT = (0.0, 1 / 3, 2 / 3, 1.0), (0.0, 0.0)


def _grid(facts: Facts) -> tuple[Tried, ...]:
    zeroed = facts.sensor_zeros
    tried = [Tried(shape=(STEP, -1.0, *STRAIGHT), log_weight=-1.0), Tried(shape=(CLOCK, 0.0, *STRAIGHT))]
    weight = -float(np.log(len(TIMES)))
    tried += [Tried(shape=(SETTLING, tau, *STRAIGHT), log_weight=weight) for tau in TIMES]
    for low, onset, high in facts.onsets:
        logged = any(low <= cycles <= high for cycles in zeroed)
        weight = 0.0 if logged else -float(np.log(len(facts.onsets)))
        tried.append(Tried(shape=(STEP, onset, *STRAIGHT), log_weight=weight))
    if facts.states.size > 2:
        courses = (LIFE,) if facts.first_moment is None else (LIFE, DAYS)
        weight = -0.7 - float(np.log(len(courses)))
        tried += [
            Tried(shape=(course, power, *STRAIGHT), log_weight=weight)
            for course in courses
            for power in (0.5, 1.0, 2.0)
        ]
    return tuple(tried)


def _courses(facts: Facts) -> tuple[Tried, ...]:
    tried = list(_grid(facts))
    if facts.states.size > 2:
        timed = facts.first_moment is not None
        weight = -0.7 - float(np.log((len(POWERS) + len(FLATTENED)) * (1 + timed)))
        for course, values in (
            (EVEN, POWERS),
            (FLATTENING, FLATTENED),
            (EVEN_DAYS, POWERS),
            (FLATTENING_DAYS, FLATTENED),
        ):
            if timed or course in {EVEN, FLATTENING}:
                tried += [Tried(shape=(course, value, *STRAIGHT), log_weight=weight) for value in values]
    return tuple(tried)


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    course, value, *off = shape
    clock, cycles = scene.points.clock, scene.points.cycles
    if course == STEP:
        share = np.where(cycles > value, 1.0, 0.0)
    elif course == CLOCK:
        share = clock / _HOUR * 2.0
    elif course == SETTLING:
        share = -np.expm1(-np.maximum(clock, 0.0) / (value * np.exp(off[0])))
    else:
        days = course in {DAYS, EVEN_DAYS, FLATTENING_DAYS}
        life = np.maximum(_gone(scene) if days else (cycles - scene.facts.states[0]) / scene.facts.life, 0.0)
        if course in {LIFE, DAYS}:
            share = life**value + np.interp(life, KNOTS, [0.0, *off, 0.0])
        elif course in {EVEN, EVEN_DAYS}:
            share = life**value
        else:
            share = life * (1.0 + value) / (life + value)
    return np.asarray(amplitude * scene.points.sign * share, dtype=np.float64)


def _gone(scene: Scene) -> FloatArray:
    """The share [P] of the campaign's days that has gone; where a test was not timed, of its cycles."""
    facts, moment = scene.facts, scene.points.moment
    by_cycles = np.asarray((scene.points.cycles - facts.states[0]) / facts.life, dtype=np.float64)
    if facts.first_moment is None or facts.last_moment is None:
        return by_cycles
    gone = (moment - facts.first_moment) / (facts.last_moment - facts.first_moment)
    return np.asarray(np.where(np.isnan(moment), by_cycles, gone), dtype=np.float64)


EFFECT = Effect(
    slug="torque_zero_shift",
    title="The torque sensor's zero has shifted",
    physics="The sensor's reading without load is not zero: from a cycle on, drifting with the test's clock (it warms), or "
    "creeping along the life, by cycles or by days. It adds the same torque at every speed and pressure.",
    formula="a · step(ζ > ζ_k), a · t/30 min, a (1 - e^{-t/τ}), or a · (ζ/ζ_last)^q or the same in days, with the sensor's "
    "sign",
    source="strain-gauge transducers: ISO 376, zero drift and creep",
    family=Family.SENSOR,
    kind=Kind.ARTEFACT,
    channels=("oil_temperature_c",),
    amplitude="zero shift",
    unit="Nm",
    prior_sd=0.5,
    positive=False,
    scale=1.0,
    shapes=(
        ShapeParameter(name="course", unit="-", lowest=0.0, highest=8.0),
        ShapeParameter(name="onset or settling time", unit="cycles or s", lowest=-1.0, highest=float("inf")),
        *(
            ShapeParameter(
                name=f"off its course at {share:.0%} of life, or log of the settling time's factor",
                unit="-",
                lowest=-0.8,
                highest=0.8,
                smooth=True,
            )
            for share in KNOTS[1:-1]
        ),
    ),
    grid=_grid,
    courses=_courses,
    change=_change,
    grows_with=Measure.TORQUE,
    before_lag=False,
    discrepancies=(Discrepancy.LIFE, Discrepancy.CLOCK),
)
