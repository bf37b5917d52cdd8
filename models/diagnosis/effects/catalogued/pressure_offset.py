"""The pressure gauge is off: the pressure at the clutch is not the recorded one."""

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
    Resemblance,
    Shape,
    ShapeParameter,
    Tried,
)

CONSTANT, GROWING, STEP = 0.0, 1.0, 2.0


def _grid(facts: Facts) -> tuple[Tried, ...]:
    tried = [Tried(shape=(CONSTANT, 0.0))]
    if facts.states.size > 2:
        tried += [Tried(shape=(GROWING, power)) for power in (0.5, 1.0, 2.0)]
        tried += [
            Tried(shape=(STEP, onset), log_weight=-float(np.log(len(facts.onsets)))) for _, onset, _ in facts.onsets
        ]
    return tuple(tried)


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    course, value = shape
    cycles = scene.points.cycles
    if course == CONSTANT:
        share = np.ones_like(cycles)
    elif course == GROWING:
        share = ((cycles - scene.facts.states[0]) / scene.facts.life) ** value
    else:
        share = np.where(cycles > value, 1.0, 0.0)
    return np.asarray(amplitude * share * scene.by_pressure, dtype=np.float64)


EFFECT = Effect(
    slug="pressure_offset",
    title="The pressure reading is off",
    physics="The pressure at the clutch differs from the gauge's reading; the torque changes as it does with pressure.",
    formula="a · ∂S/∂p, constant, growing as (ζ/ζ_last)^q, or from a cycle on",
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
        ShapeParameter(name="course", unit="-", lowest=0.0, highest=2.0),
        ShapeParameter(name="power or onset", unit="- or cycles", lowest=0.0, highest=float("inf")),
    ),
    grid=_grid,
    change=_change,
    grows_with=Measure.PRESSURE,
    before_lag=True,
    discrepancies=(Discrepancy.LIFE,),
    resembles_temperature=Resemblance.ALWAYS,
)
