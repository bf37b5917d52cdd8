"""Oil dragged around between and beside the discs: torque that grows with speed, whatever the pressure."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Measure, Shape, ShapeParameter, Tried
from models.diagnosis.effects.viscosity import log_viscosity_ratio

#: Log prior odds [nats] against a film that ruptures or a drag independent of viscosity: Newton's has neither (chosen; no
#: table).
_UNUSUAL = 1.5


def _grid(facts: Facts) -> tuple[Tried, ...]:
    thinning = (0.0, 1.0) if facts.temperature_measured else (0.0,)
    courses = ((0.6, 0.0), (1.0, 0.0), (1.5, 0.0), (1.0, 0.5), (1.0, 2.0))
    return tuple(
        Tried(shape=(power, rupture, t, lags), log_weight=-_UNUSUAL * ((rupture > 0.0) + (t < max(thinning))))
        for power, rupture in courses
        for t in thinning
        for lags in (0.0, 1.0)
    )


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    power, rupture, thinning, _ = shape
    logs = log_viscosity_ratio(scene.points.temperature, scene.facts.reference_temperature, scene.facts.oil)
    relative = scene.points.velocity / scene.laws.frame.reference_velocity
    share = relative**power * (1.0 + rupture) / (1.0 + rupture * relative**2)
    # an open clutch drags through another gap: that is the baseline's (`Scene.open_powers`), and says nothing about this one
    return np.asarray(amplitude * scene.points.engaged * share * np.exp(thinning * logs), dtype=np.float64)


EFFECT = Effect(
    slug="hydrodynamic_drag",
    title="Hydrodynamic drag beside the friction",
    physics="Oil is sheared in grooves and gaps: a torque that grows with speed and viscosity, whatever the pressure.",
    formula="a (v/v_0)^m (1 + r)/(1 + r (v/v_0)²) (ν(T)/ν_ref)^t, v_0 the middle of the speeds",
    source="Kato et al., drag torque of disengaged wet clutches; Newtonian shear in an annular gap",
    family=Family.VISCOUS,
    kind=Kind.ARTEFACT,
    channels=(),
    amplitude="drag in mid speed",
    unit="Nm",
    prior_sd=0.5,
    positive=True,
    scale=1.0,
    shapes=(
        ShapeParameter(name="power m", unit="-", lowest=0.5, highest=1.8, smooth=True),
        ShapeParameter(name="rupture of the film r", unit="-", lowest=0.0, highest=5.0),
        ShapeParameter(name="viscosity's exponent t", unit="-", lowest=0.0, highest=1.0),
        ShapeParameter(name="whether friction lags behind it", unit="-", lowest=0.0, highest=1.0),
    ),
    grid=_grid,
    change=_change,
    grows_with=Measure.TORQUE,
    before_lag=None,
    discrepancies=(Discrepancy.SPEED, Discrepancy.MOTION),
)
