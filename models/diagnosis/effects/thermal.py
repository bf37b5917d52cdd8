"""Oil and heat: viscosity over temperature, an interface that friction heats, another power of speed, and drag.

Oil warmer or colder than usual is thinner or thicker, and shears and carries accordingly. Its viscosity is that of Walther
and ASTM D341 from two measured points,

    log10 log10(ν + 0.7) = A - B log10 T,    ν in mm²/s (cSt), T in K

valid from about 2 cSt upwards and from -40 to 150 °C for mineral and similar synthetic oils (ASTM D341-20, eq. 1; the two
points are the clutch record's, 40 °C and 100 °C). Friction heats the interface above the oil's temperature by the power
density, and torque falls with it; where the plate's temperature was measured the warmth is the plate's own rise above the
oil, over what the campaign's plate rises by at the reference's flux, so that the amplitude keeps its meaning. A plate that
stays at the oil's temperature leaves nothing of this effect. The viscous term may grow with another power of speed than
0.3, and oil that is dragged around between and beside the discs adds a torque that grows with speed, whatever the pressure.
"""

import math
from functools import lru_cache

import numpy as np
from scipy.constants import zero_Celsius

from models.arrays import FloatArray, Same
from models.diagnosis import criteria
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.campaign import Oil
from models.diagnosis.design.design import Points
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
    followed,
    lagging,
    of_twice,
)
from models.friction.stribeck import GAMMA

_CST = 1e-6
_LOW, _HIGH = zero_Celsius + 40.0, zero_Celsius + 100.0


def viscosity(temperature: FloatArray, oil: Oil) -> FloatArray:
    """Kinematic viscosity ν [n] m²/s at temperature [n] K > 0.

    >>> viscosity(np.array([353.15, 363.15]), Oil()).round(8).tolist()
    [1.49e-05, 1.163e-05]
    """
    at_40, at_100 = (np.log10(np.log10(point / _CST + 0.7)) for point in (oil.viscosity_40, oil.viscosity_100))
    slope = (at_40 - at_100) / (np.log10(_HIGH) - np.log10(_LOW))
    double_log = at_40 - slope * (np.log10(np.clip(temperature, 200.0, 600.0)) - np.log10(_LOW))
    return np.asarray(np.maximum(10.0 ** (10.0**double_log) - 0.7, 1e-3) * _CST, dtype=np.float64)


def log_viscosity_ratio(temperature: FloatArray, reference: float, oil: Oil) -> FloatArray:
    """Log viscosity ratio ln ν(T)/ν(reference) [n]; 0 where the temperature [n] K was not measured (NaN)."""
    return _log_viscosity_ratio(Same(temperature), reference, oil)


@lru_cache(maxsize=8)  # the few points of a campaign, at which effects are tried over and over
def _log_viscosity_ratio(temperature: Same[FloatArray], reference: float, oil: Oil) -> FloatArray:
    """ln(ν(T)/ν(reference)) [n] of the oil at temperatures T [n] K; 0 where T was not measured."""
    measured = np.where(np.isfinite(temperature.value), temperature.value, reference)
    return np.asarray(np.log(viscosity(measured, oil) / viscosity(np.array([reference]), oil)), dtype=np.float64)


#: κ where friction depends on speed times viscosity alone: V_S goes with 1/ν where C_v v^γ goes with ν^γ.
HERSEY = -1.0 / GAMMA
#: Log of the settling time [s] of a film that follows the oil's thermometer at once, and those from which a fit starts. With
#: a film at once, sizes on the blind rig (late by 4 to 30 s) were 0.65 to 1.26 of the truth (median 0.88): 12 of 20
#: intervals of 90 % held it, 17 with this.
AT_ONCE, STARTS = math.log(0.3), (math.log(1.0), math.log(15.0))


def _oil_temperature_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (share of the Stribeck velocity, ln of the film's settling time [s]); none without a thermometer."""
    shares = (HERSEY, -1.0, 0.0, 0.5, 1.0) if facts.temperature_measured else ()
    return tuple(Tried(shape=(share, late)) for share in shares for late in STARTS)


@lru_cache(maxsize=8)  # the laws change about a film more often than its settling time does
def _film(log_viscosity: Same[FloatArray], points: Same[Points], settling: float) -> FloatArray:
    """The film's log viscosity [P], which follows the oil's with a time constant [s] (`followed`)."""
    return followed(log_viscosity.value, points.value, settling)


def _oil_temperature_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm with the measured oil temperature: viscous friction by viscosity to the power of the
    amplitude, and a shift of the Stribeck velocity by a share of it."""
    measured = log_viscosity_ratio(scene.points.temperature, scene.facts.reference_temperature, scene.facts.oil)
    logs = _film(Same(measured), Same(scene.points), math.exp(shape[1]))
    exponent = np.clip(amplitude * logs, -5.0, 5.0)
    m_s, m_c, v_s, _ = scene.parameters.T
    later = np.exp(-np.minimum(v_s * np.exp(np.clip(shape[0] * exponent, -3.0, 3.0)) / scene.points.velocity, 700.0))
    film = scene.points.engaged * m_s * (m_c - 1.0) * (later - scene.decay)
    # what the law does otherwise than eq. 3 moves along the speed as its fall does
    moved = scene.points.velocity * np.exp(np.clip(-shape[0] * exponent, -3.0, 3.0))
    off = scene.curve * (scene.learned_share(moved) - scene.learned_share(scene.points.velocity))
    return np.asarray(scene.viscous * np.expm1(exponent) + film + off, dtype=np.float64)


OIL_TEMPERATURE = Effect(
    slug="oil_temperature",
    title="Oil temperature changes the viscosity",
    article="changed",
    physics="Oil temperature differed between tests or within them; warm oil is thinner and shears more easily.",
    check="compare the oil's temperature between tests; hold it constant, or record it with each run",
    repair="hold the oil's temperature, or record it with each run",
    formula="C_v |v|^γ ((ν(T)/ν_ref)^β - 1), and V_S (ν(T)/ν_ref)^{κβ} for V_S, ν by ASTM D341 at a film's "
    "temperature, which follows the oil's within τ; κ = -1/γ with β = γ is Hersey's similarity",
    source="ASTM D341-20; M. D. Hersey, J. Wash. Acad. Sci. 4 (1914) 542; Ompusunggu et al. 2013, section 2.3 (80 to 90 °C)",
    kind=EffectKind.ARTEFACT,
    channels=("oil_temperature_c",),
    amplitude="viscosity exponent β (1: proportional)",
    unit="-",
    felt=Felt(unit="%", of=lambda β: 100.0 * (1.0 - of_twice(-β))),
    states="Halving the oil's viscosity costs {} of the viscous torque.",
    prior_sd=0.7,
    lowest=0.0,
    shapes=(
        ShapeParameter(name="share of V_S κ", unit="-", lowest=-5.0, highest=2.0, smooth=True),
        ShapeParameter(
            name="log of the film's settling time τ", unit="ln s", lowest=AT_ONCE, highest=math.log(60.0), smooth=True
        ),
    ),
    grid=_oil_temperature_grid,
    change=_oil_temperature_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED, Discrepancy.MOTION),
)


#: The heat flux to which the amplitude refers [W/m²]: the reference's 20 Nm at 1970 rpm and some, on two faces.
REFERENCE_FLUX = 0.32e6
#: What weakens: all of the friction or the oil's shear, and friction lags behind that; or so much of the torque at once.
WHOLE, VISCOUS, WHOLE_AT_ONCE, VISCOUS_AT_ONCE = 0.0, 1.0, -1.0, -2.0
#: The largest loss at the reference's flux [-]: something is left of friction.
_MOST_LOST = 0.95
#: The most that a measured rise counts for, of that at the reference's flux: a faulty thermometer must not overflow.
_MOST_WARMTH = 30.0


def _interface_heating_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (ln of the settling time [s], part of the torque, saturation) of heating at the interface; where the
    plate's temperature was measured, the part alone."""
    if facts.plate_in_all_tests:  # settling and saturation are in what was measured
        return tuple(Tried(shape=(0.0, part, 0.0)) for part in (WHOLE, VISCOUS, WHOLE_AT_ONCE, VISCOUS_AT_ONCE))
    return tuple(
        Tried(shape=(float(np.log(settling)), part, saturation))
        for settling in (0.03, 0.3, 1.5, 6.0, 30.0)
        for part in (WHOLE, VISCOUS)
        for saturation in (0.0, 1.5)
    )


def _interface_heating_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm by the lining's warming: the part S ((1 - a)^warmth - 1), S all of the curve or its
    viscous friction."""
    log_settling, part, saturation = shape
    warmth = _measured(scene, _computed(scene, float(np.exp(log_settling)), saturation))
    carried = scene.curve if part in {WHOLE, WHOLE_AT_ONCE} else scene.viscous
    return np.asarray(carried * np.expm1(np.log1p(-min(amplitude, _MOST_LOST)) * warmth), dtype=np.float64)


def _measured(scene: Scene, computed: FloatArray) -> FloatArray:
    """Relative warmth [P] of the interface, from the plate's temperature where it was measured, else as computed."""
    rise, warming = scene.points.plate_rise, scene.facts.plate_warming
    if warming is None:
        return computed
    at_rest, per_flux = warming
    warmth = np.clip((rise - at_rest) / (per_flux * REFERENCE_FLUX), -_MOST_WARMTH, _MOST_WARMTH)
    return np.where(np.isfinite(rise), warmth, computed)


def _computed(scene: Scene, settling: float, saturation: float) -> FloatArray:
    """Relative warmth [P] of the interface from the heat flux of friction, saturating and settling in `settling` s; 1
    at the reference flux."""
    geometry = scene.facts.geometry
    power = np.abs(scene.curve) * scene.points.velocity / geometry.mean_radius
    heat = power / (geometry.friction_faces * geometry.lining_area * REFERENCE_FLUX)
    heat = heat * (1.0 + saturation) / (1.0 + saturation * heat)
    warmth, looping = followed(heat, scene.points, settling), np.flatnonzero(scene.points.loop >= 0)
    if looping.size:
        velocity, frequency = by_loop(scene.points, looping)
        warmth[looping] = lagging(heat[looping].reshape(velocity.shape), frequency, settling).ravel()
    return warmth


INTERFACE_HEATING = Effect(
    slug="interface_heating",
    title="Frictional heat at the interface lowers the torque",
    physics="Frictional power heats the interface above the oil's temperature; the boundary film and the oil there lose "
    "strength.",
    check="measure the plate's temperature, or shorten the plateaus of high power",
    repair="let the plates cool between readings",
    formula="-S (1 - (1 - a)^w), w the heat flux |S| ω/A over 0.32 W/mm², saturating by s and lagging by τ; S or its "
    "viscous part; where the plate's temperature was measured w is its rise above the oil over that at 0.32 W/mm²",
    source="Marklund and Larsson, Tribology Int. 41 (2008) 824: friction of wet clutches by interface temperature",
    kind=EffectKind.ARTEFACT,
    amplitude="loss of torque at 0.32 W/mm²",
    states="Friction loses {} at 0.32 W/mm².",
    unit="%",
    prior_sd=0.1,
    lowest=0.0,
    highest=_MOST_LOST,
    scale=100.0,
    shapes=(
        ShapeParameter(name="log of the settling time τ", unit="ln s", lowest=-5.0, highest=6.0, smooth=True),
        ShapeParameter(name="what weakens", unit="-", lags_from=WHOLE),
        ShapeParameter(name="saturation s", unit="-"),
    ),
    grid=_interface_heating_grid,
    change=_interface_heating_change,
    before_lag=None,
    discrepancies=(Discrepancy.SPEED, Discrepancy.MOTION),
)


def _viscous_exponent_change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    """Change of torque [P] Nm by another exponent of viscous friction: C_v v^γ ((v/v_0)^a - 1)."""
    middle = scene.laws.frame.reference_velocity
    exponent = np.clip(amplitude, -0.6, 1.5) * np.log(scene.points.velocity / middle)
    return np.asarray(scene.viscous * np.expm1(exponent), dtype=np.float64)


VISCOUS_EXPONENT = Effect(
    slug="viscous_exponent",
    title="The viscous term has another exponent than 0.3",
    article="a different",
    physics="Another oil, or worn grooves, make viscous torque grow with speed differently from the model.",
    check="check which oil is in and whether the grooves are worn",
    formula="C_v |v|^γ ((|v|/v_0)^δ - 1), v_0 the middle of the speeds",
    source="Ompusunggu et al. 2013, section 3.1.2: γ = 0.3 fixed beforehand",
    kind=EffectKind.ARTEFACT,
    amplitude="change of exponent δ",
    unit="-",
    felt=Felt(unit="%", of=lambda δ: 100.0 * (of_twice(δ) - 1.0)),
    states="Viscous torque at twice the middle speed is {} above the model's.",
    states_below="Viscous torque at twice the middle speed is {} below the model's.",
    prior_sd=0.2,
    change=_viscous_exponent_change,
    before_lag=True,
    discrepancies=(Discrepancy.SPEED,),
)


def _hydrodynamic_drag_grid(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (power of speed, rupture, power of viscosity, lag) of drag in the grooves; Newton's, without rupture and
    proportional to viscosity, is the most probable."""
    thinning = (0.0, 1.0) if facts.temperature_measured else (0.0,)
    courses = ((0.6, 0.0), (1.0, 0.0), (1.5, 0.0), (1.0, 0.5), (1.0, 2.0))
    return tuple(
        # Newton's has neither rupture nor an independence of viscosity
        Tried(shape=(power, rupture, t, lags), log_weight=-1.5 * ((rupture > 0.0) + (t < max(thinning))))
        for power, rupture in courses
        for t in thinning
        for lags in (0.0, 1.0)
    )


def _hydrodynamic_drag_change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque [P] Nm, a x^n (1 + r)/(1 + r x²) with x = v/v_0, times viscosity to a power; none at an open
    clutch."""
    power, rupture, thinning, _ = shape
    logs = log_viscosity_ratio(scene.points.temperature, scene.facts.reference_temperature, scene.facts.oil)
    relative = scene.points.velocity / scene.laws.frame.reference_velocity
    share = relative**power * (1.0 + rupture) / (1.0 + rupture * relative**2)
    # an open clutch drags through another gap: that is the baseline's (`Scene.open_powers`), and says nothing about this one
    return np.asarray(amplitude * scene.points.engaged * share * np.exp(thinning * logs), dtype=np.float64)


HYDRODYNAMIC_DRAG = Effect(
    slug="hydrodynamic_drag",
    title="Hydrodynamic drag beside the friction",
    physics="Oil sheared in grooves and gaps adds a torque that grows with speed and viscosity, whatever the pressure.",
    check="measure the torque with the clutch open",
    formula="a (v/v_0)^m (1 + r)/(1 + r (v/v_0)²) (ν(T)/ν_ref)^t, v_0 the middle of the speeds",
    source="Kato et al., drag torque of disengaged wet clutches; Newtonian shear in an annular gap",
    kind=EffectKind.ARTEFACT,
    amplitude="drag at the middle speed",
    states="The drag is {} at the middle speed.",
    unit="Nm",
    prior_sd=0.5,
    lowest=0.0,
    highest=0.5 * criteria.USUAL_TORQUE,
    shapes=(
        ShapeParameter(name="power m", unit="-", lowest=0.5, highest=1.8, smooth=True),
        ShapeParameter(name="rupture of the film r", unit="-"),
        ShapeParameter(name="viscosity's exponent t", unit="-"),
        ShapeParameter(name="whether friction lags behind it", unit="-", lags_from=1.0),
    ),
    grid=_hydrodynamic_drag_grid,
    change=_hydrodynamic_drag_change,
    grows_with=Measure.TORQUE,
    before_lag=None,
    discrepancies=(Discrepancy.SPEED, Discrepancy.MOTION),
)
