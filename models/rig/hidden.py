"""What can be hidden in a simulated campaign, so that a diagnosis can be rehearsed: changes of torque, of one size each.

The forms are the rig's own and none of the catalogue's (`models.diagnosis.effects`), which the rig does not know: a
diagnosis is to find an effect whose shape it has wrong in detail, as on a real rig. Each changes the measured torque of a
run, noise included, by

    M' = M + change(size; velocity, pressure, oil temperature, clock, cycles)

but for the squeezed film, which is the clutch's lag. Load severity, rests and oil changes are not hidden: they need duty,
pauses and events that this campaign does not have.

Source: this project's.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import savgol_filter

from models.arrays import FloatArray
from models.friction.stribeck import GAMMA, StribeckParameters, torque
from models.records.runs import Plateaus, Record
from models.rig.hysteresis import ATTRACTOR, NO_LAG
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import PLATEAU_DURATION
from models.rig.temperatures import REFERENCE_FLUX, heat_flux, warmed
from models.rig.truth import OPEN, SimulatedClutch

#: Cycles at which late wear begins, and in which it then grows to its size.
_LATE, _LATE_SPAN = 6_000.0, 9_000.0
#: Middle of the protocol's velocities [m/s].
_MIDDLE = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """One test of a clutch: `held` as it was measured, its clock [n] s (middles of plateaus, times of samples), velocity [n]
    m/s >= 0, `curve` with the stationary parameters there, cycles since new and `wear`, the ζ of eq. 6."""

    held: Plateaus | Record
    clock: FloatArray
    velocity: FloatArray
    curve: StribeckParameters
    clutch: SimulatedClutch
    cycles: float
    wear: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenEffect:
    """An effect by its slug: what its size means, in `unit`, a size that shows, and the change of torque [n] Nm by a size in
    that unit; `loops` where only loops and raw records show it."""

    slug: str
    meaning: str
    unit: str
    size: float
    change: Callable[[float, Rows], FloatArray]
    loops: bool = False


def hidden_in(run: SimulatedRun, clutch: SimulatedClutch, sizes: Mapping[str, float]) -> SimulatedRun:
    """A simulated test with effects hidden in its torque, by slug and size; other runs as they are.

    Raises ValueError on an unknown slug.
    """
    for slug, size in sizes.items():
        effect = effect_of(slug)
        if run.duty is not None:
            continue
        held = run.record if run.record is not None else run.plateaus
        if held is None:
            continue
        changed = _changed(effect, size, held, clutch, run)
        run = replace(run, record=changed) if isinstance(changed, Record) else replace(run, plateaus=changed)
    return run


def effect_of(slug: str) -> HiddenEffect:
    """The effect of this slug; raises ValueError that lists all of them."""
    if slug not in EFFECTS:
        listed = ", ".join(
            f"{effect.slug} ({effect.meaning}: {effect.size:g}{effect.unit and ' '}{effect.unit})"
            for effect in EFFECTS.values()
        )
        raise ValueError(f"there is no hidden effect {slug!r}; there are, with their usual sizes: {listed}")
    return EFFECTS[slug]


def described(sizes: Mapping[str, float]) -> list[dict[str, str | float]]:
    """What is hidden, for the file that says so."""
    effects = [effect_of(slug) for slug in sizes]
    return [
        {"effect": effect.slug, "size": sizes[effect.slug], "unit": effect.unit, "meaning": effect.meaning}
        for effect in effects
    ]


def clutch_for(clutch: SimulatedClutch, sizes: Mapping[str, float]) -> SimulatedClutch:
    """The clutch that effects are hidden in: its friction lags by an attractor, and by a film only where that is hidden."""
    film = sizes.get("squeeze_film", 0.0)
    lag = replace(NO_LAG if film == 0.0 else clutch.lag, film_time=film, attractor=ATTRACTOR)
    return replace(clutch, lag=lag)


def _changed(
    effect: HiddenEffect, size: float, held: Plateaus | Record, clutch: SimulatedClutch, run: SimulatedRun
) -> Plateaus | Record:
    if effect.loops and isinstance(held, Plateaus):
        return held
    middles = PLATEAU_DURATION * (np.arange(held.torque.size, dtype=np.float64) + 0.5)
    rows = Rows(
        held=held,
        clock=held.time if isinstance(held, Record) else middles,
        velocity=np.abs(clutch.geometry.sliding_velocity(held.speed)),
        curve=clutch.parameters(np.maximum(held.pressure, OPEN), run.wear),
        clutch=clutch,
        cycles=run.cycles,
        wear=run.wear,
    )
    return replace(held, torque=held.torque + effect.change(size, rows))


def _in_the_lag(_: float, rows: Rows) -> FloatArray:
    """The clutch itself has the film: `clutch_for`."""
    return np.zeros_like(rows.held.torque)


def _oil_temperature(size: float, rows: Rows) -> FloatArray:
    """Hersey's similarity with Vogel's viscosity: `models.rig.temperatures`."""
    measured = Plateaus(
        pressure=rows.held.pressure,
        speed=rows.held.speed,
        torque=rows.held.torque,
        oil_temperature=rows.held.oil_temperature,
    )
    return warmed(measured, rows.clutch, rows.wear, size).torque - rows.held.torque


def _drift(cycles: float) -> float:
    """A course over a life, from 0 towards 1."""
    return cycles / (cycles + 4_000.0)


def _interface_heating(size: float, rows: Rows) -> FloatArray:
    """Torque falls as 1/(1 + s P), P the power that the faces turn into heat."""
    warmth = heat_flux(rows.held, rows.clutch.geometry) / REFERENCE_FLUX
    return np.asarray(rows.held.torque * (1 / (1 + 0.01 * size * warmth) - 1), dtype=np.float64)


def _viscous_exponent(size: float, rows: Rows) -> FloatArray:
    """C_v v^γ with ((1 + v)/(1 + v_m))^δ: the film thins with shear."""
    viscous = rows.curve.viscous_coefficient * rows.velocity**GAMMA
    return np.asarray(viscous * (((1 + rows.velocity) / (1 + _MIDDLE)) ** size - 1), dtype=np.float64)


def _hydrodynamic_drag(size: float, rows: Rows) -> FloatArray:
    """Grooves shear oil whatever the pressure, full at high speed."""
    return np.asarray(size * np.tanh(rows.velocity / _MIDDLE) / np.tanh(1.0), dtype=np.float64)


def _torque_zero_shift(size: float, rows: Rows) -> FloatArray:
    return np.full_like(rows.held.torque, size * _drift(rows.cycles))


def _pressure_offset(size: float, rows: Rows) -> FloatArray:
    """The clutch is pressed by more than the gauge says, by ever more bar."""
    pressed = np.maximum(rows.held.pressure + 1e5 * size * _drift(rows.cycles), OPEN)
    really = torque(rows.velocity, rows.clutch.parameters(pressed, rows.wear))
    return np.asarray(rows.held.torque * (really / torque(rows.velocity, rows.curve) - 1), dtype=np.float64)


def _unsettled_dwell(size: float, rows: Rows) -> FloatArray:
    """A plateau's mean still carries a share of the two plateaus before it."""
    if isinstance(rows.held, Record):
        return np.zeros_like(rows.held.torque)
    before = np.concatenate([rows.held.torque[:1], rows.held.torque[:-1]])
    earlier = np.concatenate([before[:1], before[:-1]])
    return np.asarray(0.01 * size * (0.8 * before + 0.2 * earlier - rows.held.torque), dtype=np.float64)


def _channel_delay(size: float, rows: Rows) -> FloatArray:
    return np.asarray(
        np.interp(rows.clock - 1e-3 * size, rows.clock, rows.held.torque) - rows.held.torque, dtype=np.float64
    )


def _inertia_torque(size: float, rows: Rows) -> FloatArray:
    """J dω/dt of the speed, smoothed over its sensor's noise."""
    window = min(51, rows.held.speed.size - 1 + rows.held.speed.size % 2)
    rate = savgol_filter(rows.held.speed, window, 2, deriv=1) / np.median(np.diff(rows.clock))
    return np.asarray(size * rate, dtype=np.float64)


def _shaft_ripple(size: float, rows: Rows) -> FloatArray:
    """Once a turn, and a little three times."""
    turn = np.concatenate([[0.0], np.cumsum(rows.held.speed[1:] * np.diff(rows.clock))])
    return np.asarray(size * (np.sin(turn) + 0.2 * np.sin(3 * turn)), dtype=np.float64)


def _stick_slip(size: float, rows: Rows) -> FloatArray:
    """A skewed wave of 12 Hz that fades out from 0.5 to 1.2 m/s."""
    phase = 2 * np.pi * 12.0 * rows.clock
    slow = np.clip((1.2 - rows.velocity) / 0.7, 0.0, 1.0)
    return np.asarray(size * slow * np.sin(phase + 0.5 * np.sin(phase)), dtype=np.float64)


def _running_in(size: float, rows: Rows) -> FloatArray:
    """An excess of the new lining that goes as 1/(1 + ζ/ζ_r)²."""
    return np.asarray(0.01 * size * rows.held.torque / (1 + rows.cycles / 400.0) ** 2, dtype=np.float64)


def _accelerated_wear(size: float, rows: Rows) -> FloatArray:
    """A further loss that sets in late and grows as a square."""
    late = max(rows.cycles - _LATE, 0.0) / _LATE_SPAN
    return np.asarray(-0.01 * size * late**2 * rows.held.torque, dtype=np.float64)


_ALL = (
    HiddenEffect(
        slug="oil_temperature", meaning="power of the viscosity's ratio", unit="", size=1.0, change=_oil_temperature
    ),
    HiddenEffect(
        slug="interface_heating",
        meaning="loss of torque at 0.32 W/mm²",
        unit="%",
        size=15.0,
        change=_interface_heating,
    ),
    HiddenEffect(
        slug="viscous_exponent", meaning="change of the exponent", unit="", size=0.3, change=_viscous_exponent
    ),
    HiddenEffect(slug="hydrodynamic_drag", meaning="drag in mid speed", unit="Nm", size=1.0, change=_hydrodynamic_drag),
    HiddenEffect(
        slug="torque_zero_shift", meaning="zero shift in the end", unit="Nm", size=1.5, change=_torque_zero_shift
    ),
    HiddenEffect(slug="pressure_offset", meaning="offset in the end", unit="bar", size=0.5, change=_pressure_offset),
    HiddenEffect(
        slug="unsettled_dwell",
        meaning="share of the plateaus before",
        unit="%",
        size=10.0,
        change=_unsettled_dwell,
    ),
    HiddenEffect(slug="channel_delay", meaning="delay", unit="ms", size=80.0, change=_channel_delay, loops=True),
    HiddenEffect(
        slug="inertia_torque",
        meaning="moment of inertia",
        unit="kg m²",
        size=0.01,
        change=_inertia_torque,
        loops=True,
    ),
    HiddenEffect(slug="squeeze_film", meaning="film time when new", unit="s", size=0.1, change=_in_the_lag, loops=True),
    HiddenEffect(slug="shaft_ripple", meaning="amplitude", unit="Nm", size=0.5, change=_shaft_ripple, loops=True),
    HiddenEffect(slug="stick_slip", meaning="amplitude", unit="Nm", size=1.0, change=_stick_slip, loops=True),
    HiddenEffect(slug="running_in", meaning="excess when new", unit="%", size=10.0, change=_running_in),
    HiddenEffect(
        slug="accelerated_wear",
        meaning="further loss at 15,000 cycles",
        unit="%",
        size=20.0,
        change=_accelerated_wear,
    ),
)
EFFECTS: Mapping[str, HiddenEffect] = {effect.slug: effect for effect in _ALL}
