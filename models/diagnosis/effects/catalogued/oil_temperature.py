"""Oil warmer or colder than usual is thinner or thicker, and shears and carries accordingly."""

import math

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.effects.first_order_lag import followed
from models.diagnosis.effects.viscosity import log_viscosity_ratio
from models.friction.stribeck import GAMMA

#: κ where friction depends on speed times viscosity alone: V_S goes with 1/ν where C_v v^γ goes with ν^γ.
HERSEY = -1.0 / GAMMA
#: Log of the settling time [s] of a film that follows the oil's thermometer at once, and those from which a fit starts. With
#: a film at once, sizes on the blind rig (late by 4 to 30 s) were 0.65 to 1.26 of the truth (median 0.88): 12 of 20
#: intervals of 90 % held it, 17 with this.
AT_ONCE, STARTS = math.log(0.3), (math.log(1.0), math.log(15.0))


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if not facts.temperature_measured:
        return ()
    return tuple(Tried(shape=(share, late)) for share in (HERSEY, -1.0, 0.0, 0.5, 1.0) for late in STARTS)


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    measured = log_viscosity_ratio(scene.points.temperature, scene.facts.reference_temperature, scene.facts.oil)
    logs = followed(measured, scene.points, math.exp(shape[1]))
    exponent = np.clip(amplitude * logs, -5.0, 5.0)
    m_s, m_c, v_s, _ = scene.parameters.T
    later = np.exp(-np.minimum(v_s * np.exp(np.clip(shape[0] * exponent, -3.0, 3.0)) / scene.points.velocity, 700.0))
    film = scene.points.engaged * m_s * (m_c - 1.0) * (later - scene.decay)
    return np.asarray(scene.viscous * np.expm1(exponent) + film, dtype=np.float64)


EFFECT = Effect(
    slug="oil_temperature",
    title="Oil temperature changes the viscosity",
    physics="Friction was measured at other oil temperatures than the usual one; thinner oil shears more easily and, the "
    "film being thinner, changes over to asperity contact at a higher speed.",
    formula="C_v |v|^γ ((ν(T)/ν_ref)^β - 1), and V_S (ν(T)/ν_ref)^{κβ} for V_S, ν by ASTM D341 at a film's "
    "temperature, which follows the oil's within τ; κ = -1/γ with β = γ is Hersey's similarity",
    source="ASTM D341-20; M. D. Hersey, J. Wash. Acad. Sci. 4 (1914) 542; Ompusunggu et al. 2013, section 2.3 (80 to 90 °C)",
    family=Family.THERMAL,
    kind=Kind.ARTEFACT,
    channels=("oil_temperature_c",),
    amplitude="viscosity exponent β",
    unit="-",
    prior_sd=0.7,
    positive=True,
    scale=1.0,
    shapes=(
        ShapeParameter(name="share of V_S κ", unit="-", lowest=-5.0, highest=2.0, smooth=True),
        ShapeParameter(
            name="log of the film's settling time τ", unit="ln s", lowest=AT_ONCE, highest=math.log(60.0), smooth=True
        ),
    ),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.MOTION),
)
