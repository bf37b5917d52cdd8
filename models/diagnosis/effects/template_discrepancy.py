"""Every template errs: an effect may be bent by a smooth factor that nobody wrote down.

    change · (1 + Σ_k b_k φ_k),     b_k ~ N(0, BEND²)

with φ_k cosines over the ranges of speed, life or the test's clock, or one that parts plateaus from loops: those
along which the effect's form is uncertain (`Effect.bends`). The b_k are integrated out wherever evidence is weighed or a
case is closed: so a template is held to what it says up to a tolerance, and none wins because its form happens to be the
more flexible one (after Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425).
"""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.effects.effect import Bend, Effect
from models.diagnosis.pooled_fit.gauss_newton import Fitted, effect_rows

#: Deviation of each coefficient [-].
BEND = 0.25


def bends(design: Design, effect: Effect) -> FloatArray:
    """φ [N, m] at the rows, each within ±1, along what the effect may be bent and the campaign varies."""
    rows = design.rows
    along = {
        Bend.SPEED: (rows.velocity, (1, 2)),
        Bend.LIFE: (rows.cycles, (1,)),
        Bend.CLOCK: (rows.clock, (1,)),
        Bend.MOTION: (np.where(rows.steady, 1.0, 0.0), (1,)),
    }
    found = []
    for bend in effect.bends:
        values, orders = along[bend]
        if np.ptp(values) > 0:
            unit = (values - values.min()) / np.ptp(values)
            found += [np.cos(order * np.pi * unit) for order in orders]
    return np.stack(found, axis=1) if found else np.zeros((rows.run.size, 0))


def bent_columns(design: Design, prediction: Prediction, fitted: Fitted) -> FloatArray:
    """∂torque/∂b [N, m] Nm of an effect as it is fitted."""
    return effect_rows(design, prediction, fitted)[:, None] * bends(design, fitted.effect)
