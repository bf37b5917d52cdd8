"""A dynamic record compressed: for each loop the mean torque in phase bins, and the swing at evenly spaced phases."""

import math
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.design.period_differences import repeats_of
from models.diagnosis.design.sample_autocorrelation import LEAST_SPEED as MEMORY_SPEED
from models.diagnosis.design.sample_autocorrelation import Memory, memory_of
from models.friction.stribeck import GAMMA
from models.records.criteria import SPEED_HARMONICS
from models.records.outliers import beside, inliers
from models.records.periods import Cycle, fit_cycle, harmonics
from models.records.pressure_stretches import pressure_stretches
from models.records.runs import Record

#: Phases at which a loop is computed, and bins in which it is compared; a bin holds a whole number of phases.
PHASES, BINS = 120, 60
#: Rows slower than this share of the loop's highest speed are left out: they stick, or are next to it. The second holds
#: where the swing has corners: bins cannot follow how fast the cusp of S at rest is passed there.
LEAST_SPEED, LEAST_WITH_CORNERS = 0.004, 0.012
#: This share of a period and at least so long [s] passes before the loop is in its periodic state (friction lags by S/C,
#: about 0.1 s), less where no whole period would follow; all that does is used, whole periods or not.
START, SETTLING = 0.06, 1.0
#: Phases looked at about each.
_ABOUT = 10
#: Slower than this share of the highest is as good as standing.
SLOWEST = 1e-5
#: A speed that falls below minus this share of its highest reverses.
REVERSES = 0.03
#: A loop with fewer filled bins is none.
FEWEST_BINS = 24
#: At most so many samples of a stretch are looked at, and so many for its swing (evenly taken).
MOST_SAMPLES, SWING_SAMPLES = 4000, 400
#: A swing is taken over from the stretch before where it misses by no more than this much worse.
_AS_BEFORE = 1.3


@dataclass(frozen=True, slots=True, kw_only=True)
class BinnedLoop:
    """One pressure of a dynamic test [Pa]. At PHASES phases: phase [rad], velocity [m/s] >= 0, acceleration [m/s²],
    clock [s]. In BINS bins: torque [Nm] (folded), how many samples it is the mean of, 0 where the bin is not used, and how
    far past the bin's middle [of a bin] these lie on average (where the rate is a multiple of the swing's, always as far).
    `repeats` [p, BINS] Nm is what each further period differs by (`design.period_differences`).
    temperature [K], NaN where not measured; angular_frequency [rad/s]; sign ±1. `memory` of its samples, where known."""

    pressure: float
    sign: float
    temperature: float
    angular_frequency: float
    phase: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    clock: FloatArray
    torque: FloatArray
    samples: FloatArray
    past: FloatArray
    repeats: FloatArray
    memory: Memory | None


def binned_loops(record: Record, geometry: Geometry) -> tuple[list[BinnedLoop], list[str]]:
    """The loops of a record that can be evaluated, those without pressure too, and a sentence for each that cannot (a pause
    between pressures is none)."""
    order = np.argsort(record.time, kind="stable")
    time, pressure = record.time[order], record.pressure[order]
    velocity, torque = geometry.sliding_velocity(record.speed[order]), record.torque[order]
    temperature = None if record.oil_temperature is None else record.oil_temperature[order]
    found: list[BinnedLoop] = []
    notes: list[str] = []
    before: Cycle | None = None
    for stretch in pressure_stretches(time, pressure):
        step = max(1, (stretch.stop - stretch.start) // MOST_SAMPLES)
        rows = slice(stretch.start, stretch.stop, step)
        sign = -1.0 if np.median(velocity[rows]) < 0 else 1.0
        swing = sign * velocity[rows]
        cycle = _swing(time[rows], swing, before)
        if isinstance(cycle, str):
            if stretch.pressure > 0:
                notes.append(f"{stretch.pressure / 1e5:.3g} bar: {cycle}")
            continue
        before = cycle
        mean = float("nan") if temperature is None else float(temperature[rows].mean())
        loop = _binned(cycle, time[rows], swing, sign * torque[rows], stretch.pressure, sign, mean, float(time[0]))
        if not isinstance(loop, str):
            found.append(loop)
        elif stretch.pressure > 0:
            notes.append(f"{stretch.pressure / 1e5:.3g} bar: {loop}")
    return found, notes


def _swing(time: FloatArray, velocity: FloatArray, before: Cycle | None) -> Cycle | str:
    """The stretch's swing: that of the stretch before where its frequency fits here as well, else found anew."""
    count = SPEED_HARMONICS if before is None else before.cosine.size
    step = 1 if count > SPEED_HARMONICS else max(1, time.size // SWING_SAMPLES)
    t, v = time[::step], velocity[::step]
    if before is not None and t.size > 4 * count:
        origin = 0.5 * float(t[0] + t[-1])
        basis = harmonics(2 * math.pi * before.frequency * (t - origin), count)
        design = np.column_stack([np.ones_like(t), basis])
        found = np.linalg.lstsq(design, v, rcond=None)[0]
        noise = float(np.sqrt(((v - design @ found) ** 2).mean()))
        duration = float(time[-1] - time[0]) + float(time[-1] - time[0]) / max(time.size - 1, 1)
        periods = math.floor(duration * before.frequency + 0.01)
        if periods >= 1 and noise <= _AS_BEFORE * before.noise + 1e-3 * before.amplitude:
            stop = float(time[0]) + duration
            return replace(
                before,
                origin=origin,
                mean=float(found[0]),
                cosine=np.asarray(found[1 : count + 1], dtype=np.float64),
                sine=np.asarray(found[count + 1 :], dtype=np.float64),
                periods=periods,
                begin=float(t[0]),
                start=stop - periods / before.frequency,
                stop=stop,
            )
    cycle = fit_cycle(t, v)
    if step > 1 and not isinstance(cycle, str) and cycle.cosine.size > SPEED_HARMONICS:
        return fit_cycle(time, velocity)  # corners want every sample
    return cycle


def _carrying(cycle: Cycle, time: FloatArray, velocity: FloatArray, slowest: float) -> FloatArray:
    """The velocity [PHASES] m/s whose v^γ is the mean about each phase: where a swing comes down to rest, S has a cusp that
    friction, which lags, remembers for a while. Corners are taken as they were measured, not as harmonics round them."""
    about: FloatArray = 2 * math.pi / (PHASES * _ABOUT) * (np.arange(PHASES * _ABOUT, dtype=np.float64) + 0.5)
    swing = cycle.value(about)
    if cycle.cosine.size > SPEED_HARMONICS:
        began = float(cycle.phase(np.array([cycle.start]))[0])
        when = (
            cycle.start
            + (np.mod(about - began, 2 * math.pi) / (2 * math.pi) + np.arange(cycle.periods)[:, None]) / cycle.frequency
        )
        good = inliers(velocity - cycle.value(cycle.phase(time)), velocity)
        swing = np.interp(when, time[good], velocity[good]).mean(axis=0)
    powers = np.maximum(swing, slowest) ** GAMMA
    return np.asarray(powers.reshape(PHASES, _ABOUT).mean(axis=1) ** (1 / GAMMA), dtype=np.float64)


def _binned(
    cycle: Cycle,
    time: FloatArray,
    velocity: FloatArray,
    torque: FloatArray,
    pressure: float,
    sign: float,
    temperature: float,
    begin: float,
) -> BinnedLoop | str:
    width = 2 * math.pi / PHASES
    phase = np.asarray(width * (np.arange(PHASES) + 0.5), dtype=np.float64)
    fitted = cycle.value(phase)
    fastest = float(fitted.max())
    if not fastest > 0 or float(fitted.min()) < -REVERSES * fastest:
        return "the speed changes sign; the loop was left out."
    settled = cycle.begin + max(min(SETTLING, cycle.stop - cycle.begin - 1 / cycle.frequency), START / cycle.frequency)
    inside = (time >= settled) & (time < cycle.stop)
    inside[inside] = beside(torque[inside])
    turned = np.mod(cycle.phase(time), 2 * math.pi)
    at = turned[inside] * (BINS / (2 * math.pi))
    number = np.minimum(at.astype(np.intp), BINS - 1)
    count = np.bincount(number, minlength=BINS).astype(np.float64)
    slowest = LEAST_SPEED if cycle.cosine.size <= SPEED_HARMONICS else LEAST_WITH_CORNERS
    count[fitted.reshape(BINS, -1).min(axis=1) < slowest * fastest] = 0.0
    if np.count_nonzero(count) < FEWEST_BINS:
        return "too few samples lie in whole periods."
    angular = 2 * math.pi * cycle.frequency
    # a bin's samples are of several periods: its clock is their mean
    turns = np.floor(cycle.phase(time[inside]) / (2 * math.pi))
    passed = np.bincount(number, weights=turns, minlength=BINS) / np.maximum(np.bincount(number, minlength=BINS), 1)
    lasting = float(time[inside][-1] - time[inside][0])
    to_a_bin = np.count_nonzero(inside) / (max(lasting * cycle.frequency, 0.1) * BINS)
    used = inside & (cycle.value(turned) > MEMORY_SPEED * fastest)
    return BinnedLoop(
        pressure=pressure,
        sign=sign,
        temperature=temperature,
        angular_frequency=angular,
        phase=phase,
        velocity=_carrying(cycle, time, velocity, SLOWEST * fastest),
        acceleration=angular * cycle.gradient(phase),
        clock=np.asarray(
            cycle.origin + (phase / (2 * math.pi) + np.repeat(passed, PHASES // BINS)) / cycle.frequency - begin,
            dtype=np.float64,
        ),
        torque=np.bincount(number, weights=torque[inside], minlength=BINS) / np.maximum(count, 1.0),
        samples=count,
        past=np.bincount(number, weights=at - number - 0.5, minlength=BINS) / np.maximum(count, 1.0),
        repeats=repeats_of(torque[inside], number, (time[inside] - settled) * cycle.frequency, BINS),
        memory=memory_of(torque, turned, used, to_a_bin),
    )
