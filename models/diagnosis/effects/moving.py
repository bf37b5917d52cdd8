"""What only motion shows: a mass that is accelerated, a film that lags, and two vibrations that only raw records hold.

A rotating mass stands between clutch and torque sensor. The oil film needs time to be squeezed out and drawn in: more
torque while accelerating, less while decelerating. Torque may swing with the shaft's angle, or the driveline vibrate by
itself at low speed; both average out of plateaus.
"""

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws, Scene, gradient_of
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import (
    Discrepancy,
    Effect,
    EffectKind,
    Felt,
    Measure,
    Shape,
    ShapeParameter,
    Tried,
    by_loop,
    lagging,
)
from models.friction.stribeck import GAMMA

INERTIA_TORQUE = Effect(
    slug="inertia_torque",
    title="Inertia is in the measured torque",
    article="an",
    physics="The sensor also measures the torque that accelerates a mass between it and the clutch.",
    check="check the inertia against the parts that turn between the clutch and the torque sensor",
    formula="J dω/dt",
    source="Newton; on the reference's rig the sensor stands on the grounded side, on others it does not",
    kind=EffectKind.LAG,
    channels=("time_s",),
    amplitude="moment of inertia",
    states="The mass between clutch and sensor has a moment of inertia of {}.",
    unit="kg m²",
    prior_sd=0.004,
    lowest=0.0,
    change=lambda scene, amplitude, _: amplitude * scene.points.acceleration / scene.facts.geometry.mean_radius,
    grows_with=Measure.TORQUE,
    before_lag=False,
)


#: Pressure to which the amplitude refers [Pa].
REFERENCE_PRESSURE = 5e5
#: How the film is followed: to first order by powers of speed, by its own equation, or as a thickness that relaxes and
#: whose strength and time are independent of each other.
FIRST_ORDER, FILM, THICKNESS = map(float, range(3))
#: The least time of such a thickness [s], and the power of speed that it stays below: with more it would be inertia.
LEAST_TIME, MOST_POWER = 0.15, 0.55
#: A film is followed for this share of a period before its course is taken: it no longer depends on where it began.
_BEFORE = 1 / 3
#: Points of a swing from which a film's usual slope is computed.
_SWING = 24


def _squeeze_film_grid(_facts: Facts) -> tuple[Tried, ...]:
    """Shapes tried for the squeeze film, of three forms: first order, film and thickness. All shapes of a form are
    equally probable."""
    forms = (  # powers of pressure and speed, least film, shear or time, form, lag; eq. 7 ties strength and time together
        ([(0.0, 0.6), (0.5, 1.0, 1.5), (0.02, 0.06, 0.15), (0.5,), (FIRST_ORDER,), (0.0,)], 0.0),
        ([(0.4,), (0.4, 0.8, 1.2), (0.05, 0.2), (0.2, 0.7), (FILM,), (0.0, 1.0)], 0.0),
        ([(-0.2,), (0.5, 1.2), (0.03, 0.15), (0.2, 0.8), (THICKNESS,), (0.0,)], -1.0),
    )
    return tuple(
        Tried(shape=shape, log_weight=weight - math.log(math.prod(map(len, values))))
        for values, weight in forms
        for shape in product(*values)
    )


def _squeeze_film_changes(scene: Scene, settings: Sequence[tuple[float, Shape]]) -> FloatArray:
    """Changes of torque [P, s] Nm by the squeeze film at s settings (amplitude, shape), each by its form; the film
    form is computed for all its settings at once."""
    points = scene.points
    speed = points.velocity / scene.laws.frame.reference_velocity
    out = np.zeros((speed.size, len(settings)))
    looping = np.flatnonzero((points.loop >= 0) & (points.engaged > 0))  # an open clutch has no film to squeeze
    films = [
        i for i, (amplitude, shape) in enumerate(settings) if shape[4] == FILM and amplitude > 0.0 and looping.size
    ]
    for i, (amplitude, (power, thin, least, _, form, _)) in enumerate(settings):
        if form == FIRST_ORDER:
            strength = amplitude * points.engaged * (points.pressure / REFERENCE_PRESSURE) ** power
            # torque falls faster with speed by 1/2, for fewer asperities touch; else a film would be the same at all
            # speeds, as inertia is
            out[:, i] = strength * points.acceleration / (speed + least) ** (thin + 0.5)
        elif form == THICKNESS and looping.size:
            out[looping, i] = _over_thickness(scene, looping, amplitude, settings[i][1])
    if films:
        amplitudes, shapes = np.array([settings[i][0] for i in films]), np.array([settings[i][1] for i in films])
        out[looping[:, None], films] = _over_film(scene, looping, amplitudes, shapes.T)
    return out


def _over_film(scene: Scene, looping: NDArray[np.intp], amplitude: FloatArray, shapes: FloatArray) -> FloatArray:
    """Change of torque [n, m] Nm at loops' points [n] by films [m]: w is the speed to which the present film belongs,
    ẇ = (v - w)(w/v_0 + f)^y/τ, a step from phase to phase exact for a film whose time and a speed whose slope stay;
    asperities follow w, shear grows as the film thins."""
    points, middle = scene.points, scene.laws.frame.reference_velocity
    power, thin, least, sheared = shapes[:4]
    slope = usual_slope(scene.laws, sheared)
    real = slope > 0
    velocity, frequency = by_loop(points, looping)
    phases = velocity.shape[1]
    v = np.ascontiguousarray(velocity.T)[:, :, None]
    pressure = points.pressure[looping].reshape(velocity.shape)[:, :1]
    step = 2 * np.pi / (phases * frequency)
    # of the film at mid speed [s]
    time = amplitude / np.where(real, slope, 1.0) * (pressure / REFERENCE_PRESSURE) ** power
    rate = step / np.maximum(time, 1e-12)
    change = v - np.roll(v, 1, axis=0)
    film = np.empty((phases, *rate.shape))
    behind = np.zeros_like(rate)  # v - w
    last = now = np.broadcast_to(v[-round(_BEFORE * phases) - 1], rate.shape)
    for k in range(-round(_BEFORE * phases), phases):
        steps = rate * (np.maximum(1.5 * now - 0.5 * last, 0.0) / middle + least) ** thin
        keep = np.exp(-steps)
        behind = behind * keep + change[k] * (1 - keep) / steps
        last, now = now, v[k] - behind
        film[k] = now
    speed = points.velocity[looping][:, None]
    w = np.maximum(film.transpose(1, 0, 2).reshape(looping.size, -1), 1e-3 * speed)
    m_s, m_c, v_s, _ = scene.parameters[looping].T[:, :, None]
    dry = m_s * (m_c - 1.0) * (np.exp(-np.minimum(v_s / w, 700.0)) - scene.decay[looping, None])
    thinner = np.expm1(np.clip(sheared * np.log(speed / w), -3.0, 3.0))
    return np.asarray(np.where(real, dry + scene.viscous[looping, None] * thinner, 0.0), dtype=np.float64)


def _over_thickness(scene: Scene, looping: NDArray[np.intp], amplitude: float, shape: Shape) -> FloatArray:
    """Torque [n] Nm, at loops' points, of a film of thickness h that lags its stationary thickness H = (v/v_0 + f)^q by
    the time τ, harmonic by harmonic: strength · pressure · (H - h). Asperities carry the load that the film does not,
    and carry more under pressure."""
    power, thin, least, time = shape[:4]
    points, middle = scene.points, scene.laws.frame.reference_velocity
    velocity, frequency = by_loop(points, looping)
    q, tau = MOST_POWER / (1.0 + thin), LEAST_TIME * 10.0**time
    height = (velocity / middle + least) ** q
    missing = height - lagging(height, frequency, tau)
    strength = amplitude * middle / (tau * q * (1.0 + least) ** (q - 1.0))
    pressed = (points.pressure[looping] / REFERENCE_PRESSURE) ** (1.0 + 0.5 * power)
    return np.asarray(strength * pressed * missing.ravel(), dtype=np.float64)


def usual_slope(laws: Laws, sheared: FloatArray) -> FloatArray:
    """Usual slope -∂S/∂w [m] Nm s/m of films at rest with shear exponents `sheared` [m]: the median over the usual
    swing, under the loops' pressures, half through life. It is one number for one θ, whatever rows are asked for."""
    frame = laws.frame
    swing = frame.reference_velocity * (1.0 - np.cos(2 * np.pi * (np.arange(_SWING) + 0.5) / _SWING))
    pressures = frame.loop_pressures if frame.loop_pressures.size else np.array([frame.lowest, frame.highest])
    pressure, velocity = np.repeat(pressures, _SWING), np.tile(swing, pressures.size)
    at = laws.parameters(pressure, np.full(pressure.size, 0.5 * frame.last))
    dry = -gradient_of(velocity, at)[0][:, 2] * at[:, 2] / velocity
    carried = at[:, 3] * velocity ** (GAMMA - 1.0)
    return np.asarray(np.median(sheared[:, None] * carried - dry, axis=1), dtype=np.float64)


SQUEEZE_FILM = Effect(
    slug="squeeze_film",
    title="A squeezed film lags behind the speed",
    article="a",
    physics="The oil film lags: while speed rises it is still thin from before, and torque is higher.",
    check="repeat a dynamic test with warmer oil: only a film's loop narrows",
    formula="a (p/5 bar)^x v̇ / (v/v_0 + f)^(y + 1/2), eq. 7's film to first order; or S(w) for S(v) with C_v v^γ (v/w)^s, "
    "ẇ = (v - w)(w/v_0 + f)^y/τ; or a' (p/5 bar)^(1 + x/2) (H - h), τ ḣ = H - h, "
    "H = (v/v_0 + f)^(0.55/(1 + y))",
    source="Ompusunggu et al. 2013, eq. 7 and section 3.2",
    kind=EffectKind.LAG,
    channels=("time_s",),
    amplitude="torque per acceleration at 5 bar and mid speed",
    unit="Nm s²/m",
    felt=Felt(unit="Nm per m/s²", of=lambda a: a),
    states="Acceleration adds {} at 5 bar and the middle speed.",
    prior_sd=0.05,
    lowest=0.0,
    shapes=(
        ShapeParameter(name="power of pressure x", unit="-", lowest=-0.5, highest=1.5, smooth=True),
        ShapeParameter(name="power of speed y", unit="-", lowest=0.4, highest=1.8, smooth=True),
        ShapeParameter(name="least film f", unit="-", lowest=0.003, highest=0.3, smooth=True),
        ShapeParameter(name="power of shear s, or log10 of τ/0.15 s", unit="-", lowest=0.0, highest=1.2, smooth=True),
        ShapeParameter(name="how the film is followed", unit="-"),
        ShapeParameter(name="whether friction lags behind it", unit="-", lags_from=1.0),
    ),
    grid=_squeeze_film_grid,
    several=_squeeze_film_changes,
    grows_with=Measure.TORQUE,
    before_lag=None,
    discrepancies=(Discrepancy.SPEED,),
)


def _vibration(slug: str, title: str, amplitude: str, physics: str, check: str, formula: str, source: str) -> Effect:
    """A vibration effect, which averages of plateaus and loops do not show."""
    return Effect(
        slug=slug,
        title=title,
        physics=physics,
        check=check,
        formula=formula,
        source=source,
        kind=EffectKind.VIBRATION,
        channels=("time_s",),
        amplitude=amplitude,
        states="The swing has an amplitude of {}.",
        unit="Nm",
        prior_sd=0.5,
        lowest=0.0,
        grid=lambda _: (),
        before_lag=False,
    )


SHAFT_RIPPLE = _vibration(
    "shaft_ripple",
    "Torque swings with the shaft's turns",
    "amplitude of the ripple",
    "Misalignment, run-out or a coupling: torque swings once or a few times a turn, at a frequency that follows the speed.",
    "check shaft, discs and coupling for run-out",
    "a cos(k ∫ω dt + φ), k = 1, 2, ...",
    "order analysis of rotating machinery",
)
STICK_SLIP = _vibration(
    "stick_slip",
    "Stick-slip or shudder",
    "amplitude of the vibration",
    "Where friction falls with speed the driveline vibrates by itself, at its own frequency and at low speed.",
    "record two constant low speeds: stick-slip keeps its frequency, a ripple follows the speed",
    "a cos(2π f t + φ) with f that does not follow the speed",
    "Ompusunggu et al. 2013, section 3.1.1: positive slope is anti-shudder",
)
