"""The friction law's own discrepancy as columns of torque, which are part of every explanation.

    torque = S (1 + δ),     ∂torque/∂c_j = S ∂δ/∂c_j     (`baseline.law_form`)

with S of eq. 3, over the laws of `baseline.laws`, as it fits the campaign without anything else: δ is linear, and the
columns are the same in all fits of a campaign. Friction in loops lags behind them as behind S. The three sizes of δ are
averaged over wherever evidence is (`criteria.FORM_SIZES`).
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import LawForm, LawSizes
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.baseline.prediction import predict
from models.diagnosis.design.design import Design

#: Speeds below this share of the highest count as it [-].
_LEAST_SPEED = 1e-3


@dataclass(frozen=True, slots=True)
class LawDiscrepancy:
    """The discrepancy of a campaign's law, and the laws at which it is linearised."""

    form: LawForm
    laws: Laws

    def columns(self, design: Design) -> FloatArray:
        """∂torque/∂coefficient [N, k] Nm at a design's rows."""
        prediction, points = predict(design, self.laws), design.points
        shares = self.form.shares(points.velocity, points.pressure, points.cycles)
        return prediction.change_at_rows(design, prediction.scene.curve[:, None] * shares, before_lag=True)


def law_discrepancy(design: Design, laws: Laws) -> LawDiscrepancy:
    """The discrepancy of the laws that fit a design."""
    velocity = design.rows.velocity[design.closed & design.rows.steady]
    fastest = float(velocity.max())
    form = LawForm(
        slowest=max(float(velocity.min()), _LEAST_SPEED * fastest),
        fastest=fastest,
        lowest=laws.frame.lowest,
        highest=laws.frame.highest,
        first=float(design.facts.states[0]),
        last=float(design.facts.states[-1]),
        pressures=design.levels.size,
        states=design.facts.states.size,
    )
    return LawDiscrepancy(form, laws)


def sizes_considered() -> list[tuple[LawSizes, float]]:
    """Every combination of sizes with its log prior."""
    return [
        (LawSizes(form, pressure, life), float(np.log(a * b * c)))
        for form, a in criteria.FORM_SIZES.items()
        for pressure, b in criteria.PRESSURE_SIZES.items()
        for life, c in criteria.LIFE_SIZES.items()
    ]
