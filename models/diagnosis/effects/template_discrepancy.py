"""Model discrepancy of a template: each effect may differ from its formula by a smooth factor.

    change · (1 + Σ_k b_k φ_k),     b_k ~ N(0, DISCREPANCY_SD²)

with φ_k cosines over the ranges of speed, life or the test's clock, or a contrast of plateaus against loops: those along
which the effect's form is uncertain (`Effect.discrepancies`). The b_k are integrated out wherever evidence is computed or
a case is checked. So a template is held to its formula up to a tolerance, and none wins because its form happens to be
the more flexible one (after Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425).
"""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.effects.effect import Discrepancy, Effect
from models.diagnosis.effects.fitted_effect import FittedEffect, effect_rows


def discrepancy_factors(design: Design, effect: Effect) -> FloatArray:
    """φ [N, m] at the rows, each within ±1, along what the effect's form is uncertain in and the campaign varies."""
    rows = design.rows
    along = {
        Discrepancy.SPEED: (rows.velocity, (1, 2)),
        Discrepancy.LIFE: (rows.cycles, (1,)),
        Discrepancy.CLOCK: (rows.clock, (1,)),
        Discrepancy.MOTION: (np.where(rows.steady, 1.0, 0.0), (1,)),
    }
    factors = []
    for discrepancy in effect.discrepancies:
        values, orders = along[discrepancy]
        if np.ptp(values) > 0:
            unit = (values - values.min()) / np.ptp(values)
            factors += [np.cos(order * np.pi * unit) for order in orders]
    return np.stack(factors, axis=1) if factors else np.zeros((rows.run.size, 0))


def discrepancy_columns(design: Design, prediction: Prediction, fitted: FittedEffect) -> FloatArray:
    """∂torque/∂b [N, m] Nm of an effect as it is fitted."""
    return effect_rows(design, prediction, fitted)[:, None] * discrepancy_factors(design, fitted.effect)
