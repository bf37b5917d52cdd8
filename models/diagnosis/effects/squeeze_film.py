"""The oil film needs time to be squeezed out and drawn in: more torque while accelerating, less while decelerating."""

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.effect import Bend, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.facts import Facts
from models.diagnosis.laws import Scene, curve
from models.stribeck import GAMMA

#: Pressure to which the amplitude refers [Pa].
REFERENCE_PRESSURE = 5e5
#: How the film is followed: to first order by powers of speed, or by its own equation.
FIRST_ORDER, FILM = 0.0, 1.0
#: A film is followed for this share of a period before its course is taken: it forgets where it began.
_BEFORE = 1 / 3


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    powers = [(x, y, f, 0.5, FIRST_ORDER, 0.0) for x in (0.0, 0.6) for y in (0.6, 1.0, 1.5) for f in (0.02, 0.06, 0.15)]
    films = [
        (0.4, y, f, sheared, FILM, lags)
        for y in (0.4, 0.8, 1.2)
        for f in (0.05, 0.2)
        for sheared in (0.2, 0.7)
        for lags in (0.0, 1.0)
    ]
    each = float(np.log(len(powers) / len(films)))
    return (*(Tried(shape=shape) for shape in powers), *(Tried(shape=shape, log_weight=each) for shape in films))


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    power, thin, least, sheared, form, _ = shape
    points = scene.points
    speed = points.velocity / scene.laws.frame.reference_velocity
    strength = amplitude * (points.pressure / REFERENCE_PRESSURE) ** power
    if form == FIRST_ORDER:
        return np.asarray(strength * points.acceleration / (speed + least) ** thin, dtype=np.float64)
    out = np.zeros(points.velocity.size)
    looping = np.flatnonzero(points.loop >= 0)
    carried = scene.viscous / points.velocity
    slope = (
        float(np.median((sheared * carried - scene.by_velocity + GAMMA * carried)[looping])) if looping.size else 0.0
    )
    if not (slope > 0 and amplitude > 0):
        return out
    time = strength / slope  # of the film in mid speed [s]
    out[looping] = _over_film(scene, looping, time, thin, least, sheared)
    return out


def _over_film(
    scene: Scene, looping: NDArray[np.intp], time: FloatArray, thin: float, least: float, sheared: float
) -> FloatArray:
    """Loops: w is the speed to which the present film belongs, ẇ = (v - w) (w/v_0 + f)^y/τ, a step from phase to phase
    exact for a film whose time and a speed whose slope stay; asperities follow w, shear grows as the film thins."""
    points, middle = scene.points, scene.laws.frame.reference_velocity
    phases = np.flatnonzero(np.diff(points.loop[looping], append=-2))[0] + 1
    v = points.velocity[looping].reshape(-1, phases)
    step = 2 * np.pi / (phases * points.angular_frequency[looping].reshape(-1, phases)[:, 0])
    rate = step / np.maximum(time[looping].reshape(-1, phases)[:, 0], 1e-12)
    before = np.roll(v, 1, axis=1)
    film, now = np.empty_like(v), v[:, -round(_BEFORE * phases) - 1]
    last = now
    for k in range(-round(_BEFORE * phases), phases):
        halfway = 1.5 * now - 0.5 * last
        steps = rate * (np.maximum(halfway, 0.0) / middle + least) ** thin
        keep = np.exp(-steps)
        last, now = now, v[:, k] + (now - before[:, k]) * keep - (v[:, k] - before[:, k]) * (1 - keep) / steps
        film[:, k] = now
    speed = v.ravel()
    w = np.maximum(film.ravel(), 1e-3 * speed)
    dry = scene.parameters[looping] * np.array([1.0, 1.0, 1.0, 0.0])
    thinner = np.expm1(np.clip(sheared * np.log(speed / w), -3.0, 3.0))
    return np.asarray(curve(w, dry) - curve(speed, dry) + scene.viscous[looping] * thinner, dtype=np.float64)


EFFECT = Effect(
    slug="squeeze_film",
    title="A squeezed film lags behind the speed",
    physics="While speed rises the film is still thin from before and more asperities carry: torque is higher than "
    "stationary, also where the curve rises; the GMS attractor cannot give that.",
    formula="a (p/5 bar)^x v̇ / (v/v_0 + f)^y, eq. 7's film to first order; or S(w) for S(v) with C_v v^γ (v/w)^s, "
    "ẇ = (v - w)(w/v_0 + f)^y/τ",
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
        ShapeParameter(name="power of speed y", unit="-", lowest=0.4, highest=1.8, smooth=True),
        ShapeParameter(name="least film f", unit="-", lowest=0.003, highest=0.3, smooth=True),
        ShapeParameter(name="power of shear s", unit="-", lowest=0.0, highest=1.2, smooth=True),
        ShapeParameter(name="how the film is followed", unit="-", lowest=0.0, highest=1.0),
        ShapeParameter(name="whether friction lags behind it", unit="-", lowest=0.0, highest=1.0),
    ),
    grid=_grid,
    change=_change,
    before_lag=None,
    bends=(Bend.SPEED,),
    tests={
        "inertia_torque": "loops at 0.5 Hz, or the same swing with the clutch open: a film's torque goes, inertia stays",
        "channel_delay": "loops at 0.5 Hz about several mean speeds",
        "baseline": "loops at 0.3 and 0.5 Hz",
    },
)
