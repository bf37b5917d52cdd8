"""The oil film needs time to be squeezed out and drawn in: more torque while accelerating, less while decelerating."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.effect import Bend, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.facts import Facts
from models.diagnosis.laws import Scene

#: Pressure to which the amplitude refers [Pa].
REFERENCE_PRESSURE = 5e5


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(
        Tried(shape=(power, thin, least))
        for power in (0.0, 0.6)
        for thin in (0.6, 1.0, 1.5)
        for least in (0.02, 0.06, 0.15)
    )


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    power, thin, least = shape
    points = scene.points
    middle = scene.laws.frame.reference_velocity
    film = (points.velocity / middle + least) ** thin
    strength = (points.pressure / REFERENCE_PRESSURE) ** power
    return np.asarray(amplitude * strength * points.acceleration / film, dtype=np.float64)


EFFECT = Effect(
    slug="squeeze_film",
    title="A squeezed film lags behind the speed",
    physics="While speed rises the film is still thin from before and more asperities carry: torque is higher than "
    "stationary, also where the curve rises; the GMS attractor cannot give that.",
    formula="a (p/5 bar)^x v̇ / (v/v_0 + f)^y, eq. 7's film to first order",
    source="Ompusunggu et al. 2013, eq. 7 and section 3.2",
    family=Family.DYNAMIC,
    kind=Kind.LAG,
    channels=("time_s",),
    amplitude="torque per acceleration at 5 bar and mid speed",
    unit="Nm s²/m",
    prior_sd=0.2,
    positive=True,
    scale=1.0,
    shapes=(
        ShapeParameter(name="power of pressure x", unit="-", lowest=-0.5, highest=1.5, smooth=True),
        ShapeParameter(name="power of speed y", unit="-", lowest=0.6, highest=1.6, smooth=True),
        ShapeParameter(name="least film f", unit="-", lowest=0.003, highest=0.15, smooth=True),
    ),
    grid=_grid,
    change=_change,
    before_lag=False,
    bends=(Bend.SPEED,),
    tests={
        "inertia_torque": "loops at 0.5 Hz, or the same swing with the clutch open: a film's torque goes, inertia stays",
        "channel_delay": "loops at 0.5 Hz about several mean speeds",
        "baseline": "loops at 0.3 and 0.5 Hz",
    },
)
