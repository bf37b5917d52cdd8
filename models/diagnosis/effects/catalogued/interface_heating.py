"""Friction heats the interface above the oil's temperature, and torque falls with the power density."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.effects.first_order_lag import ends_of, phases_of

#: The heat flux to which the amplitude refers [W/m²]: the reference's 20 Nm at 1970 rpm and some, on two faces.
REFERENCE_FLUX = 0.32e6
#: What weakens: all of the friction, or the oil's shear.
WHOLE, VISCOUS = 0.0, 1.0


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(
        Tried(shape=(float(np.log(settling)), part, saturation))
        for settling in (0.03, 0.3, 1.5, 6.0, 30.0)
        for part in (WHOLE, VISCOUS)
        for saturation in (0.0, 1.5)
    )


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    log_settling, part, saturation = shape
    settling = float(np.exp(log_settling))
    geometry = scene.facts.geometry
    power = np.abs(scene.curve) * scene.points.velocity / geometry.mean_radius
    heat = power / (geometry.friction_faces * geometry.lining_area * REFERENCE_FLUX)
    heat = heat * (1.0 + saturation) / (1.0 + saturation * heat)
    warmth = _around(_along(heat, scene, settling), scene, settling)
    carried = scene.curve if part == WHOLE else scene.viscous
    return np.asarray(-carried * -np.expm1(-amplitude * warmth), dtype=np.float64)


def _along(heat: FloatArray, scene: Scene, settling: float) -> FloatArray:
    """Plateaus: the interface approaches each one's own warmth, from what the one before left; the mean of a plateau."""
    previous, clock = scene.points.previous, scene.points.clock
    follows = np.flatnonzero(previous >= 0)  # each follows the point just before it
    ratio = np.maximum(clock[follows] - clock[previous[follows]], 1e-6) / settling
    keep = np.zeros(previous.size)
    keep[follows] = np.exp(-ratio)
    left = ends_of(heat, keep)
    out = heat.copy()
    out[follows] += (left[previous[follows]] - heat[follows]) * (1.0 - keep[follows]) / ratio
    return out


def _around(heat: FloatArray, scene: Scene, settling: float) -> FloatArray:
    """Loops: the periodic answer of the same first-order lag, harmonic by harmonic."""
    points = scene.points
    looping = np.flatnonzero(points.loop >= 0)
    if not looping.size:
        return heat
    phases = phases_of(points, looping)
    waves = np.fft.rfft(heat[looping].reshape(-1, phases), axis=1)
    frequency = points.angular_frequency[looping].reshape(-1, phases)[:, :1]
    waves /= 1 + 1j * np.arange(waves.shape[1]) * frequency * settling
    out = heat.copy()
    out[looping] = np.fft.irfft(waves, phases, axis=1).ravel()
    return out


EFFECT = Effect(
    slug="interface_heating",
    title="Frictional heat at the interface lowers the torque",
    physics="Frictional power heats the interface above the oil's temperature; the boundary film and the oil there lose "
    "strength.",
    formula="-S (1 - e^{-a w}), w the heat flux |S| ω/A over 0.32 W/mm², saturating by s and lagging by τ; S or its "
    "viscous part",
    source="Marklund and Larsson, Tribology Int. 41 (2008) 824: friction of wet clutches by interface temperature",
    family=Family.THERMAL,
    kind=Kind.ARTEFACT,
    channels=(),
    amplitude="loss of torque at 0.32 W/mm²",
    unit="%",
    prior_sd=0.1,
    positive=True,
    scale=100.0,
    shapes=(
        ShapeParameter(name="log of the settling time τ", unit="ln s", lowest=-5.0, highest=6.0, smooth=True),
        ShapeParameter(name="what weakens", unit="-", lowest=0.0, highest=1.0),
        ShapeParameter(name="saturation s", unit="-", lowest=0.0, highest=6.0),
    ),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.MOTION),
)
