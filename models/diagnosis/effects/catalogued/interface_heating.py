"""Friction heats the interface above the oil's temperature, and torque falls with it.

The interface's warmth is computed from the power density. Where the plate's temperature was measured it is the plate's own
rise above the oil, over what the campaign's plate rises by at the reference's flux, so that the amplitude keeps its meaning.
A plate that stays at the oil's temperature leaves nothing of this effect.
"""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Discrepancy, Effect, Family, Kind, Shape, ShapeParameter, Tried
from models.diagnosis.effects.first_order_lag import followed, phases_of

#: The heat flux to which the amplitude refers [W/m²]: the reference's 20 Nm at 1970 rpm and some, on two faces.
REFERENCE_FLUX = 0.32e6
#: What weakens: all of the friction, or the oil's shear.
WHOLE, VISCOUS = 0.0, 1.0
#: The most that a measured rise counts for, of that at the reference's flux: a faulty thermometer must not overflow.
_MOST_WARMTH = 30.0


def _grid(facts: Facts) -> tuple[Tried, ...]:
    if facts.plate_in_all_tests:  # settling and saturation are in what was measured
        return tuple(Tried(shape=(0.0, part, 0.0)) for part in (WHOLE, VISCOUS))
    return tuple(
        Tried(shape=(float(np.log(settling)), part, saturation))
        for settling in (0.03, 0.3, 1.5, 6.0, 30.0)
        for part in (WHOLE, VISCOUS)
        for saturation in (0.0, 1.5)
    )


def _change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    log_settling, part, saturation = shape
    warmth = _measured(scene, _computed(scene, float(np.exp(log_settling)), saturation))
    carried = scene.curve if part == WHOLE else scene.viscous
    return np.asarray(-carried * -np.expm1(-amplitude * warmth), dtype=np.float64)


def _measured(scene: Scene, computed: FloatArray) -> FloatArray:
    """The interface's warmth [P], by the plate's temperature where it was measured, else as computed."""
    rise, warming = scene.points.plate_rise, scene.facts.plate_warming
    if warming is None:
        return computed
    at_rest, per_flux = warming
    warmth = np.clip((rise - at_rest) / (per_flux * REFERENCE_FLUX), -_MOST_WARMTH, _MOST_WARMTH)
    return np.where(np.isfinite(rise), warmth, computed)


def _computed(scene: Scene, settling: float, saturation: float) -> FloatArray:
    """The interface's warmth [P] by the flux of friction, saturating and settling in `settling` s; 1 at the reference's."""
    geometry = scene.facts.geometry
    power = np.abs(scene.curve) * scene.points.velocity / geometry.mean_radius
    heat = power / (geometry.friction_faces * geometry.lining_area * REFERENCE_FLUX)
    heat = heat * (1.0 + saturation) / (1.0 + saturation * heat)
    return _around(followed(heat, scene.points, settling), scene, settling)


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
    "viscous part; where the plate's temperature was measured w is its rise above the oil over that at 0.32 W/mm²",
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
