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
from models.diagnosis.baseline.law_form import MARGIN, LawForm, LawSizes
from models.diagnosis.baseline.laws import STRIBECK_VELOCITY, Laws
from models.diagnosis.baseline.prediction import predict
from models.diagnosis.design.design import Design

#: Places of pressure and of √life at which V_S is taken, and the most that it moves the law's form along ln v [-]: where a
#: curve shows no fall, V_S is anything.
_NODES, _MOST_MOVED = np.linspace(0.0, 1.0, 41), 1.0
#: Speeds below this share of the highest count as it [-].
_LEAST_SPEED = 1e-3


@dataclass(frozen=True, slots=True)
class LawDiscrepancy:
    """The discrepancy of a campaign's law, and the laws at which it is linearised."""

    form: LawForm
    laws: Laws

    def columns(self, design: Design) -> FloatArray:
        """Sensitivities ∂torque/∂coefficient [N, k] Nm at a design's rows."""
        prediction, points = predict(design, self.laws), design.points
        shares = self.form.shares(points.velocity, points.pressure, points.cycles)
        return prediction.change_at_rows(design, prediction.scene.curve[:, None] * shares, before_lag=True)


def law_discrepancy(design: Design, laws: Laws, *, moving: bool) -> LawDiscrepancy:
    """The discrepancy of the laws that fit a design; with `moving` its form shifts along speed as V_S does over
    pressure and life."""
    velocity = design.rows.velocity[design.closed & design.rows.steady]
    first, last = float(design.facts.states[0]), float(design.facts.states[-1])
    by_pressure, by_life = _moved(laws, first, last) if moving else (np.zeros(1), np.zeros(1))
    fastest = float(velocity.max() * np.exp(-by_pressure.min() - by_life.min()))
    slowest = float(velocity.min() * np.exp(-by_pressure.max() - by_life.max()))
    form = LawForm(
        slowest=max(slowest, _LEAST_SPEED * fastest),
        fastest=fastest,
        lowest=laws.frame.lowest,
        highest=laws.frame.highest,
        first=first,
        last=last,
        pressures=design.levels.size,
        states=design.facts.states.size,
        moved_by_pressure=tuple(by_pressure.tolist()),
        moved_by_life=tuple(by_life.tolist()),
    )
    return LawDiscrepancy(form, laws)


def _moved(laws: Laws, first: float, last: float) -> tuple[FloatArray, FloatArray]:
    """Shift of ln V_S [NODES] relative to the middle pressure at the first state: over pressure at the first state, and
    over √life at the middle pressure. Both are 0 if V_S moves by more than MOST_MOVED."""
    lowest, highest = laws.frame.lowest, laws.frame.highest
    pressures = lowest + (highest - lowest) * np.clip(_NODES * (1.0 + 2.0 * MARGIN) - MARGIN, 0.0, 1.0)
    cycles, middle = first + (last - first) * _NODES**2, np.full(_NODES.size, 0.5 * (lowest + highest))
    over = (pressures, np.full(_NODES.size, first)), (middle, cycles)
    by_pressure, by_life = (np.log(laws.parameters(*places)[:, STRIBECK_VELOCITY]) for places in over)
    by_pressure, by_life = by_pressure - by_life[0], by_life - by_life[0]
    if max(np.abs(by_pressure).max(), np.abs(by_life).max()) > _MOST_MOVED:
        return np.zeros(1), np.zeros(1)
    return by_pressure, by_life


def sizes_considered() -> list[tuple[LawSizes, float]]:
    """All combinations of the law's sizes, each with its log prior [nats]."""
    return [
        (LawSizes(form, pressure, life), float(np.log(a * b * c)))
        for form, a in criteria.FORM_SIZES.items()
        for pressure, b in criteria.PRESSURE_SIZES.items()
        for life, c in criteria.LIFE_SIZES.items()
    ]
