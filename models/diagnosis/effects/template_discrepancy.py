"""Model discrepancy of a template: each effect may differ from its formula by a smooth factor.

    change · (1 + Σ_k b_k φ_k),     b_k ~ N(0, DISCREPANCY_SD²)

with φ_k cosines over the ranges of speed, life or the test's clock, or a contrast of plateaus against loops: those along
which the effect's form is uncertain (`Effect.discrepancies`). The b_k are integrated out wherever evidence is computed or
a case is checked. So a template is held to its formula up to a tolerance, and none wins because its form happens to be
the more flexible one (after Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425).
"""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.design.points import Points
from models.diagnosis.effects.effect import Discrepancy, Effect
from models.diagnosis.effects.fitted_effect import FittedEffect, effect_rows

#: Along what φ is uncertain: the lowest value and the range in a campaign.
Ranges: TypeAlias = Mapping[Discrepancy, tuple[float, float]]
_ORDERS = {Discrepancy.SPEED: (1, 2), Discrepancy.LIFE: (1,), Discrepancy.CLOCK: (1,), Discrepancy.MOTION: (1,)}


def ranges_of(rows: Points) -> Ranges:
    """The ranges over which a campaign's rows vary."""
    return {along: (float(values.min()), float(np.ptp(values))) for along, values in _along(rows).items()}


def factors_at(points: Points, effect: Effect, ranges: Ranges) -> FloatArray:
    """φ [P, m] at points, each within ±1, along what the effect's form is uncertain in and a campaign varied; beyond its
    range that at its end."""
    values, factors = _along(points), list[FloatArray]()
    for discrepancy in effect.discrepancies:
        low, width = ranges[discrepancy]
        if width > 0:
            unit = np.clip((values[discrepancy] - low) / width, 0.0, 1.0)
            factors += [np.cos(order * np.pi * unit) for order in _ORDERS[discrepancy]]
    return np.stack(factors, axis=1) if factors else np.zeros((points.run.size, 0))


def _along(points: Points) -> dict[Discrepancy, FloatArray]:
    return {
        Discrepancy.SPEED: points.velocity,
        Discrepancy.LIFE: points.cycles,
        Discrepancy.CLOCK: points.clock,
        Discrepancy.MOTION: np.where(points.steady, 1.0, 0.0),
    }


def discrepancy_factors(design: Design, effect: Effect) -> FloatArray:
    """φ [N, m] at the rows of a campaign."""
    return factors_at(design.rows, effect, ranges_of(design.rows))


def discrepancy_columns(design: Design, prediction: Prediction, fitted: FittedEffect) -> FloatArray:
    """∂torque/∂b [N, m] Nm of an effect as it is fitted."""
    return effect_rows(design, prediction, fitted)[:, None] * discrepancy_factors(design, fitted.effect)
