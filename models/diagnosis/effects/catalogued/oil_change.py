"""Fresh oil: shear and boundary friction step at a cycle."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried

#: Log prior odds [nats] of an unlogged change against a logged one (chosen; no table).
_UNLOGGED = -2.0


def _grid(facts: Facts) -> tuple[Tried, ...]:
    tried = []
    for low, onset, high in facts.onsets:
        logged = any(low <= cycles <= high for cycles in facts.oil_changes)
        weight = 0.0 if logged else (_UNLOGGED if facts.oil_changes else 0.0) - float(np.log(len(facts.onsets)))
        tried += [Tried(shape=(onset, share, lost), log_weight=weight) for share in (-0.1, 0.1) for lost in (0.0, 0.5)]
    return tuple(tried)


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    onset, share, lost = shape
    since = scene.points.cycles - onset
    ageing = 1.0 - lost * -np.expm1(-np.maximum(since, 0.0) / (0.5 * scene.facts.life))
    boundary = scene.gradient[:, 1] * scene.parameters[:, 1]
    step = (scene.viscous + share * boundary) * ageing
    return np.asarray(amplitude * np.where(since > 0, step, 0.0), dtype=np.float64)


EFFECT = Effect(
    slug="oil_change",
    title="The oil was changed",
    physics="Fresh oil has another viscosity and fresh friction modifiers: the viscous term steps, the boundary friction a "
    "little.",
    formula="a (C_v |v|^γ + k M̄_c ∂S/∂M̄_c) (1 - l (1 - e^{-2(ζ - ζ_k)/ζ_last})) after ζ_k",
    source="maintenance practice; friction modifiers deplete with use",
    family=Family.HISTORY,
    kind=Kind.COURSE,
    channels=(),
    amplitude="step of C_v",
    unit="%",
    prior_sd=0.15,
    positive=False,
    scale=100.0,
    shapes=(
        ShapeParameter(name="cycle ζ_k", unit="cycles", lowest=0.0, highest=float("inf")),
        ShapeParameter(name="share of M̄_c k", unit="-", lowest=-0.5, highest=0.5, smooth=True),
        ShapeParameter(name="share lost again as the oil ages", unit="-", lowest=0.0, highest=1.0, smooth=True),
    ),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE),
)
