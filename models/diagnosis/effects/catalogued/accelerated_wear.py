"""Late in life the lining goes faster than eq. 6 says."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if facts.states.size < 4:
        return ()
    onsets = sorted({cycles for low, onset, _ in facts.onsets[1:] for cycles in (low, onset)})
    weight = -float(np.log(len(onsets)))
    return tuple(Tried(shape=(onset, power), log_weight=weight) for onset in onsets for power in (1.0, 2.0))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    onset, power = shape
    late = np.maximum(scene.points.cycles - onset, 0.0) / max(float(scene.facts.states[-1]) - onset, 1.0)
    return np.asarray(
        -amplitude * scene.gradient[:, 0] * scene.parameters[:, 0] * np.minimum(late, 10.0) ** power, dtype=np.float64
    )


EFFECT = Effect(
    slug="accelerated_wear",
    title="Wear accelerates late in life",
    physics="Glazing, lost porosity or torn fibres: from a cycle on the static torque falls faster than eq. 6.",
    formula="-a M_s ∂S/∂M_s ((ζ - ζ_k)₊/(ζ_last - ζ_k))^q",
    source="Ompusunggu et al. 2013, figs. 4 and 5: glazing and lost porosity",
    family=Family.HISTORY,
    kind=Kind.COURSE,
    channels=(),
    amplitude="further loss of static torque by the last state",
    unit="%",
    prior_sd=0.1,
    positive=True,
    scale=100.0,
    shapes=(
        ShapeParameter(name="onset ζ_k", unit="cycles", lowest=0.0, highest=float("inf")),
        ShapeParameter(name="power q", unit="-", lowest=0.5, highest=3.0),
    ),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.LIFE),
)
