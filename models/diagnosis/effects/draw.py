"""One way in which a case may be: the effects at work with their sizes, shapes and model discrepancies, and the laws beside.

What adoption takes off measurements and adds to a life is a weighted set of such draws (`diagnosis.extension`), whatever
made them. Within a draw the correction of all runs of a life is one function: runs are not off independently of each other.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws, Scene
from models.diagnosis.effects.effect import Effect, Kind, Shape
from models.diagnosis.effects.template_discrepancy import Ranges, factors_at


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnEffect:
    """An effect at an amplitude and a shape, its change multiplied by 1 + Σ_k b_k φ_k; `factors` are b [m]."""

    effect: Effect
    amplitude: float
    shape: Shape
    factors: tuple[float, ...] = ()

    def change(self, scene: Scene, ranges: Ranges) -> FloatArray:
        """Change of torque [P] Nm. A course that is followed far enough ends friction; it does not reverse it."""
        change = self.effect.change(scene, self.amplitude, self.shape)
        if any(self.factors):
            change = change * (1.0 + factors_at(scene.points, self.effect, ranges) @ np.array(self.factors))
        return np.maximum(change, -scene.curve) if self.effect.kind is Kind.COURSE else change


@dataclass(frozen=True, slots=True, kw_only=True)
class Draw:
    """The effects at work (none: nothing is), beside these laws, and the draw's weight > 0."""

    weight: float
    laws: Laws
    effects: tuple[DrawnEffect, ...] = ()
