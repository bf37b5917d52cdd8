"""A dynamic record compressed: for each loop the mean torque in phase bins, and the speed cycle at evenly spaced phases.

What is locked to the speed cycle is the same in every period, so what differs between periods is noise, however slow (a
drift over the test's clock differs too, by what it does within some periods). The residual about the harmonics of a single
period says little about slow noise, for the harmonics absorb it. With ȳ_b the mean of n_b samples in a bin of this period
and m̄_b that of the N_b samples of the bin in all periods before,

    d_b = (ȳ_b - m̄_b)/(1/n_b + 1/N_b)^{1/2}

has the variance of a single sample and the correlation of neighbouring bins.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis import criteria
from models.diagnosis.design.autocorrelation import SampleAutocorrelation, sample_autocorrelation
from models.friction.stribeck import GAMMA
from models.records.criteria import SPEED_HARMONICS
from models.records.outliers import beside, inliers
from models.records.periods import Cycle, fit_cycle, harmonics
from models.records.pressure_levels import pressure_stretches
from models.records.runs import Record, plate_rise


def period_differences(torque: FloatArray, bins: NDArray[np.intp], turns: FloatArray, count: int) -> FloatArray:
    """Deviations [p - 1, count] Nm of each bin's mean from its mean over all earlier periods, scaled to one sample's
    deviation, from torque [n] Nm, its bins [n] (0 ... count - 1) and the periods since the start [n], of which p were
    begun. NaN where no earlier period has samples in the bin, or this period has too few."""
    turn = np.floor(turns).astype(np.intp)
    periods = int(turn.max(initial=0)) + 1
    cell = turn * count + bins
    samples = np.bincount(cell, minlength=periods * count).reshape(periods, count).astype(np.float64)
    sums = np.bincount(cell, weights=torque, minlength=periods * count).reshape(periods, count)
    # where the record begins or ends, samples lie elsewhere in the bin
    full = samples >= (2 / 3) * samples.max(axis=0)
    samples, sums = np.where(full, samples, 0.0), np.where(full, sums, 0.0)
    before, sum_before = np.cumsum(samples, axis=0)[:-1], np.cumsum(sums, axis=0)[:-1]
    samples_here, sum_here = samples[1:], sums[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(
            (sum_here / samples_here - sum_before / before) / np.sqrt(1 / samples_here + 1 / before), dtype=np.float64
        )


#: Phases at which a loop is computed, and bins in which it is compared; a bin holds a whole number of phases. With two a bin
#: the torque next to rest is off by up to 0.013 % of the clutch's, which passed for a delay of 2 ms on a rig of 0.1 % noise;
#: with three by 0.003 %.
PHASES, BINS = 180, 60
#: Phases over which v^γ is averaged about each phase.
_FINE = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class BinnedLoop:
    """A loop at one pressure of a dynamic test, at PHASES phases and in BINS bins."""

    pressure: float  # [Pa]
    sign: float
    temperature: float  # [K], NaN where not measured
    angular_frequency: float  # [rad/s]
    phase: FloatArray  # [PHASES] rad
    velocity: FloatArray  # [PHASES] m/s >= 0
    acceleration: FloatArray  # [PHASES] m/s²
    clock: FloatArray  # [PHASES] s
    plate_rise: FloatArray  # [PHASES] K above the oil, NaN where not measured
    torque: FloatArray  # [BINS] Nm, folded
    samples: FloatArray  # [BINS] how many the torque is the mean of, 0 where the bin is not used
    # [BINS] how far past the bin's middle [of a bin] they lie (with a rate that is a multiple of the speed's, always as far)
    bin_offset: FloatArray
    period_differences: FloatArray  # [p, BINS] Nm
    autocorrelation: SampleAutocorrelation | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stretch:
    """The samples [n] of a record at one pressure, folded to v >= 0."""

    time: FloatArray  # [s]
    velocity: FloatArray  # [m/s]
    torque: FloatArray  # [Nm]
    pressure: float  # [Pa]
    sign: float
    temperature: float  # mean of the oil [K]
    plate_rise: FloatArray | None  # above the oil [n] K, None where not measured
    test_start: float  # the record's first time [s]


def binned_loops(record: Record, geometry: Geometry) -> tuple[list[BinnedLoop], list[str]]:
    """The loops of a record that can be evaluated, loops without pressure too, and a sentence for each that cannot
    (none for a pause between pressures)."""
    record = record.take(np.argsort(record.time, kind="stable"))
    velocity, rise = geometry.sliding_velocity(record.speed), plate_rise(record)
    loops: list[BinnedLoop] = []
    notes: list[str] = []
    before: Cycle | None = None
    for stretch in pressure_stretches(record.time, record.pressure):
        step = max(1, (stretch.stop - stretch.start) // 4000)
        rows = slice(stretch.start, stretch.stop, step)
        sign = -1.0 if np.median(velocity[rows]) < 0 else 1.0
        samples = _Stretch(
            time=record.time[rows],
            velocity=sign * velocity[rows],
            torque=sign * record.torque[rows],
            pressure=stretch.pressure,
            sign=sign,
            temperature=math.nan if record.oil_temperature is None else float(record.oil_temperature[rows].mean()),
            plate_rise=None if rise is None else rise[rows],
            test_start=float(record.time[0]),
        )
        cycle = _speed_cycle(samples.time, samples.velocity, before)
        if not isinstance(cycle, str):
            before = cycle
        loop = cycle if isinstance(cycle, str) else _binned(samples, cycle)
        if not isinstance(loop, str):
            loops.append(loop)
        elif stretch.pressure > 0:
            notes.append(f"{stretch.pressure / 1e5:.3g} bar: {loop}")
    return loops, notes


def _speed_cycle(time: FloatArray, velocity: FloatArray, before: Cycle | None) -> Cycle | str:
    """The speed cycle of a stretch of one pressure, or the reason why there is none: with the frequency of the stretch
    before where that fits here too, else fitted again."""
    count = SPEED_HARMONICS if before is None else before.cosine.size
    step = 1 if count > SPEED_HARMONICS else max(1, time.size // 400)  # corners need every sample
    t, v = time[::step], velocity[::step]
    if before is not None and t.size > 4 * count:
        duration = float(time[-1] - time[0]) + float(time[-1] - time[0]) / max(time.size - 1, 1)
        same = _same_frequency(t, v, duration, before)
        if same is not None:
            return same
    cycle = fit_cycle(t, v)
    if step > 1 and not isinstance(cycle, str) and cycle.cosine.size > SPEED_HARMONICS:
        return fit_cycle(time, velocity)  # corners need every sample
    return cycle


def _same_frequency(time: FloatArray, velocity: FloatArray, duration: float, before: Cycle) -> Cycle | None:
    """The cycle of velocity [n] m/s at time [n] s at the frequency of the cycle `before`; None where the stretch of that
    duration [s] holds no period of it, or the error is larger than it was there."""
    count, origin = before.cosine.size, 0.5 * float(time[0] + time[-1])
    basis = harmonics(2 * math.pi * before.frequency * (time - origin), count)
    columns = np.column_stack([np.ones_like(time), basis])
    coefficients = np.linalg.lstsq(columns, velocity, rcond=None)[0]
    noise = float(np.sqrt(((velocity - columns @ coefficients) ** 2).mean()))
    periods = math.floor(duration * before.frequency + 0.01)
    if periods < 1 or noise > 1.3 * before.noise + 1e-3 * before.amplitude:
        return None
    stop = float(time[0]) + duration
    return replace(
        before,
        origin=origin,
        mean=float(coefficients[0]),
        cosine=np.asarray(coefficients[1 : count + 1], dtype=np.float64),
        sine=np.asarray(coefficients[count + 1 :], dtype=np.float64),
        periods=periods,
        begin=float(time[0]),
        start=stop - periods / before.frequency,
        stop=stop,
    )


def _effective_velocity(cycle: Cycle, time: FloatArray, velocity: FloatArray, slowest: float) -> FloatArray:
    """Effective velocity [PHASES] m/s, the power mean of order γ about each phase: where the speed comes down to rest,
    S has a cusp that friction, which lags, carries on for a while. A speed with corners is taken as it was measured,
    for harmonics round them."""
    fine: FloatArray = 2 * math.pi / (PHASES * _FINE) * (np.arange(PHASES * _FINE, dtype=np.float64) + 0.5)
    speed = cycle.value(fine)
    if cycle.cosine.size > SPEED_HARMONICS:
        first = float(cycle.phase(np.array([cycle.start]))[0])
        turns = np.mod(fine - first, 2 * math.pi) / (2 * math.pi) + np.arange(cycle.periods)[:, None]
        good = inliers(velocity - cycle.value(cycle.phase(time)), velocity)
        speed = np.interp(cycle.start + turns / cycle.frequency, time[good], velocity[good]).mean(axis=0)
    powers = np.maximum(speed, slowest) ** GAMMA
    return np.asarray(powers.reshape(PHASES, _FINE).mean(axis=1) ** (1 / GAMMA), dtype=np.float64)


def _binned(stretch: _Stretch, cycle: Cycle) -> BinnedLoop | str:
    """The stretch's loop, or a sentence with the reason why it is left out."""
    time, torque = stretch.time, stretch.torque
    width = 2 * math.pi / PHASES
    phase = np.asarray(width * (np.arange(PHASES) + 0.5), dtype=np.float64)
    speed = cycle.value(phase)
    fastest = float(speed.max())
    if not fastest > 0 or float(speed.min()) < -0.03 * fastest:
        return "the speed changes sign; the loop was left out."
    settling = min(criteria.SETTLING_TIME, cycle.stop - cycle.begin - 1 / cycle.frequency)
    settled = cycle.begin + max(settling, criteria.SETTLING_SHARE / cycle.frequency)
    inside = (time >= settled) & (time < cycle.stop)
    inside[inside] = beside(torque[inside])
    sample_phase = np.mod(cycle.phase(time), 2 * math.pi)
    position = sample_phase[inside] * (BINS / (2 * math.pi))
    number = np.minimum(position.astype(np.intp), BINS - 1)
    count = np.bincount(number, minlength=BINS).astype(np.float64)
    # slower it sticks; with corners bins cannot resolve how fast the cusp of S at rest is passed
    slowest = 0.004 if cycle.cosine.size <= SPEED_HARMONICS else 0.012
    count[speed.reshape(BINS, -1).min(axis=1) < slowest * fastest] = 0.0
    if np.count_nonzero(count) < 24:
        return "too few samples lie in whole periods."
    # a bin's samples are of several periods: its clock is their mean
    turns = np.floor(cycle.phase(time[inside]) / (2 * math.pi))
    mean_turn = np.bincount(number, weights=turns, minlength=BINS) / np.maximum(np.bincount(number, minlength=BINS), 1)
    passed = phase / (2 * math.pi) + np.repeat(mean_turn, PHASES // BINS)
    duration = float(time[inside][-1] - time[inside][0])
    per_bin = np.count_nonzero(inside) / (max(duration * cycle.frequency, 0.1) * BINS)
    moving = inside & (cycle.value(sample_phase) > 0.08 * fastest)  # slower a loop turns sharply, which is not noise
    angular = 2 * math.pi * cycle.frequency
    return BinnedLoop(
        pressure=stretch.pressure,
        sign=stretch.sign,
        temperature=stretch.temperature,
        angular_frequency=angular,
        phase=phase,
        velocity=_effective_velocity(cycle, time, stretch.velocity, 1e-5 * fastest),  # lest v^γ meets 0
        acceleration=angular * cycle.gradient(phase),
        plate_rise=_plate_rise(stretch, inside, number, phase),
        clock=np.asarray(cycle.origin + passed / cycle.frequency - stretch.test_start, dtype=np.float64),
        torque=np.bincount(number, weights=torque[inside], minlength=BINS) / np.maximum(count, 1.0),
        samples=count,
        bin_offset=np.bincount(number, weights=position - number - 0.5, minlength=BINS) / np.maximum(count, 1.0),
        period_differences=period_differences(torque[inside], number, (time[inside] - settled) * cycle.frequency, BINS),
        autocorrelation=sample_autocorrelation(torque, sample_phase, moving, per_bin),
    )


def _plate_rise(
    stretch: _Stretch, inside: NDArray[np.bool_], number: NDArray[np.intp], phase: FloatArray
) -> FloatArray:
    """Temperature rise [PHASES] K of the plate at the phases, by linear interpolation of the bins' means (`number` is
    the bin of each sample inside)."""
    if stretch.plate_rise is None:
        return np.full(phase.size, np.nan)
    count = np.bincount(number, minlength=BINS)
    filled = np.flatnonzero(count)
    mean = np.bincount(number, weights=stretch.plate_rise[inside], minlength=BINS)[filled] / count[filled]
    return np.interp(phase, 2 * math.pi / BINS * (filled + 0.5), mean, period=2 * math.pi)
