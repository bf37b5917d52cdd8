"""A gain of the torque sensor that steps or creeps over the life, as after another calibration."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.axes import CYCLES
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Shape, Tried
from models.diagnosis.effects.uncatalogued.criteria import CREEP_POWERS
from models.diagnosis.effects.uncatalogued.fault import uncatalogued_fault

#: The first shape says which course it is, the second is the step's cycle or the creep's power.
_STEP, _CREEP = 0.0, 1.0


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if facts.states.size < 3:
        return ()
    weight = -float(np.log(len(facts.onsets)))
    steps = tuple(Tried(shape=(_STEP, onset), log_weight=weight) for _, onset, _ in facts.onsets)
    weight = -float(np.log(len(CREEP_POWERS)))
    return steps + tuple(Tried(shape=(_CREEP, power), log_weight=weight) for power in CREEP_POWERS)


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    course, value = shape
    cycles = scene.points.cycles
    life = np.maximum((cycles - scene.facts.states[0]) / scene.facts.life, 0.0)
    share = np.where(cycles > value, 1.0, 0.0) if course == _STEP else life**value
    return np.asarray(amplitude * share * scene.curve, dtype=np.float64)


FAULT = uncatalogued_fault(
    slug="gain_with_life",
    description="a gain of the torque that steps or creeps over the life, as after another calibration",
    formula="a S from a cycle on, or a S (ζ/ζ_last)^q",
    axis=CYCLES,
    grid=_grid,
    change=_change,
    shapes=2,
)
