"""Oil warmer or colder than usual is thinner or thicker, and shears and carries accordingly."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.effect import Bend, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.facts import Facts
from models.diagnosis.laws import Scene
from models.diagnosis.viscosity import log_viscosity_ratio


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if not facts.temperature_measured:
        return ()
    return tuple(Tried(shape=(share,)) for share in (0.0, 0.5, 1.0))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    logs = log_viscosity_ratio(scene.points.temperature, scene.facts.reference_temperature, scene.facts.oil)
    exponent = np.clip(amplitude * logs, -5.0, 5.0)
    film = scene.gradient[:, 2] * scene.parameters[:, 2] * shape[0] * exponent
    return np.asarray(scene.viscous * np.expm1(exponent) + film, dtype=np.float64)


EFFECT = Effect(
    slug="oil_temperature",
    title="Oil temperature changes the viscosity",
    physics="Friction was measured at other oil temperatures than the usual one; thinner oil shears more easily and, the "
    "film being thinner, changes over to asperity contact at a higher speed.",
    formula="C_v |v|^γ ((ν(T)/ν_ref)^β - 1) + κβ ln(ν(T)/ν_ref) V_S ∂S/∂V_S, ν by ASTM D341",
    source="ASTM D341-20; Ompusunggu et al. 2013, section 2.3 (80 to 90 °C)",
    family=Family.THERMAL,
    kind=Kind.ARTEFACT,
    channels=("oil_temperature_c",),
    amplitude="viscosity exponent β",
    unit="-",
    prior_sd=0.7,
    positive=False,
    scale=1.0,
    shapes=(ShapeParameter(name="share of V_S κ", unit="-", lowest=-1.0, highest=2.0, smooth=True),),
    grid=_grid,
    change=_change,
    before_lag=True,
    bends=(Bend.SPEED, Bend.MOTION),
    tests={
        "torque_zero_shift": "one sweep at 60 °C oil temperature: a shifted zero does not follow it",
        "baseline": "one sweep at 60 °C and one at 95 °C oil temperature",
    },
)
