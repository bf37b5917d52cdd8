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
from typing import TypeAlias

import numpy as np
from scipy.signal import savgol_filter

from models.arrays import FloatArray
from models.friction.stribeck import GAMMA, StribeckParameters, torque
from models.records.runs import Plateaus, Record
from models.rig.hysteresis import ATTRACTOR, NO_LAG
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import PLATEAU_DURATION
from models.rig.temperatures import REFERENCE_FLUX, heat_flux, warm_torque
from models.rig.truth import OPEN, SimulatedClutch

#: Middle of the protocol's velocities [m/s].
_MIDDLE = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenTest:
    """One test of a clutch in which an effect is hidden: `held` as it was measured, its clock [n] s (middles of
    plateaus, times of samples), velocity [n] m/s >= 0, `curve` with the stationary parameters there, cycles since new
    and `wear`, the ζ of eq. 6."""

    held: Plateaus | Record
    clock: FloatArray
    velocity: FloatArray
    curve: StribeckParameters
    clutch: SimulatedClutch
    cycles: float
    wear: float


TorqueChange: TypeAlias = Callable[[float, HiddenTest], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenEffect:
    """An effect that can be hidden, by its slug: the meaning of its size, in `unit`, a size that shows, and the change
    of torque [n] Nm by a size in that unit; `loops` where only loops and raw records show it."""

    slug: str
    meaning: str
    unit: str
    size: float
    change: TorqueChange
    loops: bool = False


def hidden_in(run: SimulatedRun, clutch: SimulatedClutch, sizes: Mapping[str, float]) -> SimulatedRun:
    """A simulated test with effects hidden in its torque, by slug and size; other runs unchanged.

    Raises ValueError on an unknown slug.
    """
    for slug, size in sizes.items():
        effect = effect_of(slug)
        if run.duty is not None:
            continue
        measured = run.record if run.record is not None else run.plateaus
        if measured is None:
            continue
        changed = _with_effect(effect, size, measured, clutch, run)
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
    """Hidden effects as rows of slug, size, unit and meaning, for the file that accompanies the campaign."""
    effects = [effect_of(slug) for slug in sizes]
    return [
        {"effect": effect.slug, "size": sizes[effect.slug], "unit": effect.unit, "meaning": effect.meaning}
        for effect in effects
    ]


def clutch_for(clutch: SimulatedClutch, sizes: Mapping[str, float]) -> SimulatedClutch:
    """The clutch in which effects are hidden: its friction lags by an attractor, and by a film only where that is
    hidden."""
    film = sizes.get("squeeze_film", 0.0)
    lag = replace(NO_LAG if film == 0.0 else clutch.lag, film_time=film, attractor=ATTRACTOR)
    return replace(clutch, lag=lag)


#: By their slugs.
EFFECTS: dict[str, HiddenEffect] = {}


def _hides(meaning: str, unit: str = "", *, size: float, loops: bool = False) -> Callable[[TorqueChange], TorqueChange]:
    """A decorator that registers a change of torque as an effect, whose slug is the function's name."""

    def listed(change: TorqueChange) -> TorqueChange:
        slug = change.__name__.removeprefix("_")
        EFFECTS[slug] = HiddenEffect(slug=slug, meaning=meaning, unit=unit, size=size, change=change, loops=loops)
        return change

    return listed


def _with_effect(
    effect: HiddenEffect, size: float, held: Plateaus | Record, clutch: SimulatedClutch, run: SimulatedRun
) -> Plateaus | Record:
    """Channels of a test with the effect's change of torque added; a stationary test is unchanged by an effect of loops
    alone."""
    if effect.loops and isinstance(held, Plateaus):
        return held
    middles = PLATEAU_DURATION * (np.arange(held.torque.size, dtype=np.float64) + 0.5)
    rows = HiddenTest(
        held=held,
        clock=held.time if isinstance(held, Record) else middles,
        velocity=np.abs(clutch.geometry.sliding_velocity(held.speed)),
        curve=clutch.parameters(np.maximum(held.pressure, OPEN), run.wear),
        clutch=clutch,
        cycles=run.cycles,
        wear=run.wear,
    )
    return replace(held, torque=held.torque + effect.change(size, rows))


@_hides("power of the viscosity's ratio", size=1.0)
def _oil_temperature(size: float, rows: HiddenTest) -> FloatArray:
    return warm_torque(rows.held, rows.clutch, rows.wear, size) - rows.held.torque


def _drift(cycles: float) -> float:
    """A course over a life, from 0 towards 1."""
    return cycles / (cycles + 4_000.0)


@_hides("loss of torque at 0.32 W/mm²", "%", size=15.0)
def _interface_heating(size: float, rows: HiddenTest) -> FloatArray:
    """Torque falls as 1/(1 + s P), P the power that the faces turn into heat."""
    warmth = heat_flux(rows.held, rows.clutch.geometry) / REFERENCE_FLUX
    return np.asarray(rows.held.torque * (1 / (1 + 0.01 * size * warmth) - 1), dtype=np.float64)


@_hides("change of the exponent", size=0.3)
def _viscous_exponent(size: float, rows: HiddenTest) -> FloatArray:
    """C_v v^γ with ((1 + v)/(1 + v_m))^δ: the film thins with shear."""
    viscous = rows.curve.viscous_coefficient * rows.velocity**GAMMA
    return np.asarray(viscous * (((1 + rows.velocity) / (1 + _MIDDLE)) ** size - 1), dtype=np.float64)


@_hides("drag in mid speed", "Nm", size=1.0)
def _hydrodynamic_drag(size: float, rows: HiddenTest) -> FloatArray:
    """Grooves shear oil whatever the pressure, full at high speed."""
    return np.asarray(size * np.tanh(rows.velocity / _MIDDLE) / np.tanh(1.0), dtype=np.float64)


@_hides("zero shift in the end", "Nm", size=1.5)
def _torque_zero_shift(size: float, rows: HiddenTest) -> FloatArray:
    return np.full_like(rows.held.torque, size * _drift(rows.cycles))


@_hides("offset in the end", "bar", size=0.5)
def _pressure_offset(size: float, rows: HiddenTest) -> FloatArray:
    """The clutch is pressed by more than the gauge says, by ever more bar."""
    pressed = np.maximum(rows.held.pressure + 1e5 * size * _drift(rows.cycles), OPEN)
    really = torque(rows.velocity, rows.clutch.parameters(pressed, rows.wear))
    return np.asarray(rows.held.torque * (really / torque(rows.velocity, rows.curve) - 1), dtype=np.float64)


@_hides("share of the plateaus before", "%", size=10.0)
def _unsettled_dwell(size: float, rows: HiddenTest) -> FloatArray:
    """A plateau's mean still carries a share of the two plateaus before it."""
    if isinstance(rows.held, Record):
        return np.zeros_like(rows.held.torque)
    before = np.concatenate([rows.held.torque[:1], rows.held.torque[:-1]])
    earlier = np.concatenate([before[:1], before[:-1]])
    return np.asarray(0.01 * size * (0.8 * before + 0.2 * earlier - rows.held.torque), dtype=np.float64)


@_hides("delay", "ms", size=80.0, loops=True)
def _channel_delay(size: float, rows: HiddenTest) -> FloatArray:
    return np.asarray(
        np.interp(rows.clock - 1e-3 * size, rows.clock, rows.held.torque) - rows.held.torque, dtype=np.float64
    )


@_hides("moment of inertia", "kg m²", size=0.01, loops=True)
def _inertia_torque(size: float, rows: HiddenTest) -> FloatArray:
    """J dω/dt of the speed, smoothed over its sensor's noise."""
    window = min(51, rows.held.speed.size - 1 + rows.held.speed.size % 2)
    rate = savgol_filter(rows.held.speed, window, 2, deriv=1) / np.median(np.diff(rows.clock))
    return np.asarray(size * rate, dtype=np.float64)


@_hides("film time when new", "s", size=0.1, loops=True)
def _squeeze_film(_: float, rows: HiddenTest) -> FloatArray:
    """No change of a test's torque [n]: the film belongs to the simulated clutch itself (`clutch_for`)."""
    return np.zeros_like(rows.held.torque)


@_hides("amplitude", "Nm", size=0.5, loops=True)
def _shaft_ripple(size: float, rows: HiddenTest) -> FloatArray:
    """Once a turn, and a little three times."""
    turn = np.concatenate([[0.0], np.cumsum(rows.held.speed[1:] * np.diff(rows.clock))])
    return np.asarray(size * (np.sin(turn) + 0.2 * np.sin(3 * turn)), dtype=np.float64)


@_hides("amplitude", "Nm", size=1.0, loops=True)
def _stick_slip(size: float, rows: HiddenTest) -> FloatArray:
    """A skewed wave of 12 Hz that fades out from 0.5 to 1.2 m/s."""
    phase = 2 * np.pi * 12.0 * rows.clock
    slow = np.clip((1.2 - rows.velocity) / 0.7, 0.0, 1.0)
    return np.asarray(size * slow * np.sin(phase + 0.5 * np.sin(phase)), dtype=np.float64)


@_hides("excess when new", "%", size=10.0)
def _running_in(size: float, rows: HiddenTest) -> FloatArray:
    """An excess of the new lining that goes as 1/(1 + ζ/ζ_r)²."""
    return np.asarray(0.01 * size * rows.held.torque / (1 + rows.cycles / 400.0) ** 2, dtype=np.float64)


@_hides("further loss at 15,000 cycles", "%", size=20.0)
def _accelerated_wear(size: float, rows: HiddenTest) -> FloatArray:
    """A further loss that sets in late and grows as a square."""
    late = max(rows.cycles - 6_000.0, 0.0) / 9_000.0
    return np.asarray(-0.01 * size * late**2 * rows.held.torque, dtype=np.float64)
