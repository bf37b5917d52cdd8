"""Raw stationary records for tests: what a recorder would write of a protocol, with the truth of every plateau."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.clutch import Geometry
from models.records.runs import Record

GEOMETRY = Geometry()
RPM = 2 * np.pi / 60
PRESSURES = np.arange(4.0, 7.25, 0.5) * 1e5
SPEEDS = np.arange(20.0, 1971.0, 50.0) * RPM


def true_torque(pressure: FloatArray, speed: FloatArray) -> FloatArray:
    """Eq. 3 with coefficients that follow pressure, odd in speed and zero without pressure or motion [Nm]."""
    bar = np.maximum(np.asarray(pressure) / 1e5, 0.0)
    velocity = GEOMETRY.sliding_velocity(np.maximum(np.abs(speed), 1e-9))
    static, viscous = 2.8 * bar + 3.0, 0.25 * bar + 0.5
    ratio, stribeck = 0.62 + 0.5 * np.exp(-bar / 3.0), 0.4 + 0.25 * bar
    dry = static * (1 + (ratio - 1) * np.exp(-stribeck / velocity)) + viscous * velocity**0.3
    return np.sign(speed) * dry * np.minimum(bar, 1.0)


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Deviations of a sample: torque [Nm] (with an AR(1) coefficient), speed [rad/s], pressure [Pa]; counts of each."""

    torque: float = 0.25
    memory: float = 0.0
    speed: float = 3 * RPM
    pressure: float = 2000.0
    torque_count: float = 0.0
    speed_count: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Made:
    """A record and its dwells: start, stop [n] s, pressure, speed, torque [n], the asymptote of each."""

    record: Record
    start: FloatArray
    stop: FloatArray
    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray


def make(
    pressure: Sequence[float] | FloatArray,
    speed: Sequence[float] | FloatArray,
    rng: np.random.Generator,
    *,
    dwell: float = 5.0,
    ramp: float = 0.15,
    tau: float = 0.05,
    rate: float = 1000.0,
    sensors: Sensors | None = None,
    idle: float = 0.0,
) -> Made:
    """Step through (pressure, speed) [n], `dwell` s each of which the first `ramp` s lead there from the one before.

    Torque lags what it would be at rest by first order with `tau` s. `idle` s without pressure and motion at both ends.
    """
    sensors = sensors or Sensors()
    p, w = np.asarray(pressure, dtype=float), np.asarray(speed, dtype=float)
    ends = idle + dwell * np.arange(p.size + 1)
    steps = ends if idle else ends[1:-1]
    knots = np.concatenate([[0.0], np.stack([steps, steps + ramp], axis=1).ravel(), [ends[-1] + idle]])
    ps, ws = (np.repeat([0.0, *levels, 0.0] if idle else levels, 2) for levels in (p, w))
    fine = max(rate, 1000.0)
    factor = round(fine / rate)
    time = np.arange(0.0, knots[-1], 1 / fine)
    pressure_now, speed_now = np.interp(time, knots, ps), np.interp(time, knots, ws)
    steady = true_torque(pressure_now, speed_now)
    step = 1 - np.exp(-1 / (fine * tau))
    torque = lfilter([step], [1, step - 1], steady, zi=[(1 - step) * steady[0]])[0]
    time, pressure_now, speed_now, torque = (x[::factor] for x in (time, pressure_now, speed_now, torque))
    n = time.size
    white = rng.standard_normal(n) * np.sqrt(1 - sensors.memory**2)
    coloured = lfilter([1], [1, -sensors.memory], white)
    record = Record(
        time=time,
        pressure=pressure_now + sensors.pressure * rng.standard_normal(n),
        speed=_counted(speed_now + sensors.speed * rng.standard_normal(n), sensors.speed_count),
        torque=_counted(torque + sensors.torque * coloured, sensors.torque_count),
        oil_temperature=358.15 + 0.3 * np.sin(time / 200) + 0.05 * rng.standard_normal(n),
    )
    return Made(record=record, start=ends[:-1], stop=ends[1:], pressure=p, speed=w, torque=true_torque(p, w))


def _counted(values: FloatArray, count: float) -> FloatArray:
    return values if count == 0 else np.round(values / count) * count


def lose(record: Record, share: float, rng: np.random.Generator, *, gap: bool = False) -> Record:
    """Without a share of the samples, at random or all in one gap."""
    n = record.time.size
    if gap:
        first = int(rng.integers(0, n - int(share * n)))
        keep = np.ones(n, dtype=bool)
        keep[first : first + int(share * n)] = False
    else:
        keep = rng.random(n) >= share
    return record.take(keep)


def jitter(record: Record, rng: np.random.Generator, share: float = 0.15) -> Record:
    """Times off by a share of the interval; some repeated, some swapped with the next."""
    period = float(np.median(np.diff(record.time)))
    time = record.time + share * period * rng.standard_normal(record.time.size)
    for k in rng.integers(1, time.size - 1, size=10):
        time[k] = time[k - 1]
    for k in rng.integers(1, time.size - 1, size=10):
        time[[k, k + 1]] = time[[k + 1, k]]
    return replace(record, time=time)


def spike(record: Record, rng: np.random.Generator, every: float = 60.0, longest: int = 3) -> Record:
    """A spike of 1 to `longest` samples in a channel drawn at random, about one in `every` s."""
    columns = {name: getattr(record, name).copy() for name in ("pressure", "speed", "torque")}
    for _ in range(max(1, round((record.time[-1] - record.time[0]) / every))):
        column = columns[str(rng.choice(list(columns)))]
        at, length = int(rng.integers(0, column.size - longest)), int(rng.integers(1, longest + 1))
        column[at : at + length] += (
            rng.choice([-1, 1]) * rng.uniform(3, 30) * np.ptp(column[:: max(1, column.size // 999)])
        )
    return replace(record, **columns)


def protocol(rng: np.random.Generator | None = None, speeds: FloatArray = SPEEDS) -> tuple[FloatArray, FloatArray]:
    """Pressure and speed [n] of the reference's protocol, or with pressures, and directions of speed, drawn."""
    if rng is None:
        return np.repeat(PRESSURES, speeds.size), np.tile(speeds, PRESSURES.size)
    order = rng.permutation(PRESSURES)
    columns = [speeds if rng.random() < 0.5 else speeds[::-1] for _ in order]
    return np.repeat(order, speeds.size), np.concatenate(columns)


def harmed(record: Record, harm: str, rng: np.random.Generator) -> Record:
    """The record with samples lost, a gap, jitter or spikes, or all of these but the gap."""
    if harm in ("lost", "all"):
        record = lose(record, 0.01, rng)
    if harm == "gap":
        record = lose(record, 0.01, rng, gap=True)
    if harm in ("jitter", "all"):
        record = jitter(record, rng)
    if harm in ("spikes", "all"):
        record = spike(record, rng)
    return record
