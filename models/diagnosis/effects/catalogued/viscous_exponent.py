"""The viscous term grows with another power of speed than 0.3."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, Tried


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return (Tried(shape=()),)


def _change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    middle = scene.laws.frame.reference_velocity
    exponent = np.clip(amplitude, -0.6, 1.5) * np.log(scene.points.velocity / middle)
    return np.asarray(scene.viscous * np.expm1(exponent), dtype=np.float64)


EFFECT = Effect(
    slug="viscous_exponent",
    title="The viscous term has another exponent than 0.3",
    physics="How shear grows with speed depends on the film (0.3 is elastohydrodynamic); grooves, porosity or another oil "
    "give another power.",
    formula="C_v |v|^γ ((|v|/v_0)^δ - 1), v_0 the middle of the speeds",
    source="Ompusunggu et al. 2013, section 3.1.2: γ = 0.3 fixed beforehand",
    family=Family.VISCOUS,
    kind=Kind.ARTEFACT,
    channels=(),
    amplitude="change of exponent δ",
    unit="-",
    prior_sd=0.2,
    positive=False,
    scale=1.0,
    shapes=(),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED,),
)
