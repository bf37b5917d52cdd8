"""Faults that step at a cycle: the grid of onsets, and the change of torque by another parameter of eq. 3 from then on."""

from collections.abc import Callable

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Shape, Tried
from models.friction.stribeck import PARAMETER_NAMES


def onset_grid(facts: Facts) -> tuple[Tried, ...]:
    """Every onset, none with fewer than three states."""
    return tuple(Tried(shape=(onset,)) for _, onset, _ in facts.onsets) if facts.states.size > 2 else ()


def stepped(relative: FloatArray, scene: Scene, amplitude: float, onset: float) -> FloatArray:
    """amplitude times `relative` [P] Nm after the cycle `onset`, 0 before."""
    return np.asarray(amplitude * np.where(scene.points.cycles > onset, relative, 0.0), dtype=np.float64)


def parameter_step(parameter: str) -> Callable[[Scene, float, Shape], FloatArray]:
    """The change a θ ∂S/∂θ by a parameter θ of eq. 3 (one of PARAMETER_NAMES) from the cycle in the first shape on."""
    place = PARAMETER_NAMES.index(parameter)

    def change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
        return stepped(scene.gradient[:, place] * scene.parameters[:, place], scene, amplitude, shape[0])

    return change
