"""Campaigns of raw records with lines hidden in them, made without the product's own simulated rig."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.records.runs import Plateaus, Record

RPM = 2 * np.pi / 60
RADIUS = 0.058
RATE = 200.0
LEVELS = (4.0e5, 6.0e5)


def friction(speed: FloatArray, pressure: FloatArray) -> FloatArray:
    velocity = np.maximum(np.abs(speed) * RADIUS, 1e-9)
    return pressure / 25e3 * (1 - 0.4 * np.exp(-1.5 / velocity)) + 2 * velocity**0.3


def noise(rng: np.random.Generator, size: int, memory: float = 0.8, deviation: float = 0.2) -> FloatArray:
    innovations = rng.standard_normal(size)
    return np.asarray(deviation * lfilter([np.sqrt(1 - memory**2)], [1, -memory], innovations), dtype=np.float64)


def stepped(rng: np.random.Generator, *, settling: float = 0.1, memory: float = 0.8) -> Record:
    """Twenty speeds at two pressures, five seconds each, torque settling exponentially."""
    dwell = int(5 * RATE)
    speed = np.repeat(np.tile(np.arange(20.0, 1971.0, 100.0) * RPM, len(LEVELS)), dwell)
    pressure = np.repeat(LEVELS, 20 * dwell)
    keep = np.exp(-1 / RATE / settling)
    steady = friction(speed, pressure)
    torque = lfilter([1 - keep], [1, -keep], steady, zi=[keep * steady[0]])[0]
    time = np.arange(speed.size) / RATE
    return Record(time=time, pressure=pressure, speed=speed, torque=torque + noise(rng, time.size, memory))


def swinging(rng: np.random.Generator, memory: float = 0.8) -> Record:
    """A dynamic test: 15 s of 0.1 Hz at each pressure."""
    count = int(15 * RATE)
    speed = np.tile((1000 - 1000 * np.cos(2 * np.pi * 0.1 * np.arange(count) / RATE)) * RPM, len(LEVELS))
    pressure = np.repeat(LEVELS, count)
    time = np.arange(speed.size) / RATE
    return Record(
        time=time, pressure=pressure, speed=speed, torque=friction(speed, pressure) + noise(rng, time.size, memory)
    )


def reversing(
    rng: np.random.Generator, *, frequency: float = 0.1, rate: float = 100.0, deviation: float = 0.05
) -> Record:
    """A speed that swings about rest at three pressures, 40 s each; friction turns with it, within 5 cm/s of rest; white
    noise."""
    size = int(40 * rate)
    speed = np.tile(1000 * RPM * np.sin(2 * np.pi * frequency * np.arange(size) / rate), 3)
    pressure = np.repeat(np.linspace(4e5, 7e5, 3), size)
    torque = np.tanh(speed * RADIUS / 0.05) * friction(speed, pressure) + deviation * rng.standard_normal(speed.size)
    return Record(time=np.arange(speed.size) / rate, pressure=pressure, speed=speed, torque=torque)


def loops(
    rng: np.random.Generator,
    *,
    rate: float = 100.0,
    memory: float = 0.4,
    deviation: float = 0.15,
    count: float = 0.01,
    pointed: bool = False,
) -> Record:
    """A dynamic test of 0.1 Hz at seven pressures, 15 s each and 3 s between; speed swings as a sine or is pointed."""
    size = int(15 * rate)
    swing = np.cos(2 * np.pi * 0.1 * np.arange(size) / rate)
    speed = np.tile((1000 - 1000 * (2 / np.pi * np.arcsin(swing) if pointed else swing)) * RPM, 7)
    pressure = np.repeat(np.linspace(4e5, 7e5, 7), size)
    time = np.arange(speed.size) / rate + 3.0 * (np.arange(speed.size) // size)
    torque = friction(speed, pressure) + noise(rng, time.size, memory, deviation)
    return Record(time=time, pressure=pressure, speed=speed, torque=np.round(torque / count) * count)


def with_bursts(record: Record, rng: np.random.Generator, amplitude: float, hertz: float, below: float) -> Record:
    """A skewed wave at speeds below `below` rad/s, its phase anew in every passage."""
    slow = (record.speed < below).astype(int)
    passage = np.cumsum(np.diff(slow, prepend=0) > 0)
    phase = 2 * np.pi * (hertz * record.time + rng.random(passage.max() + 1)[passage])
    return _added(record, amplitude * slow * np.sin(phase + 0.4 * np.sin(phase)))


def with_wandering_ripple(record: Record, rng: np.random.Generator, amplitude: float, order: float) -> Record:
    """A ripple whose phase is anew in every loop and wanders by about a radian in one, its size with the torque."""
    step = float(np.median(np.diff(record.time)))
    loop = np.cumsum(np.diff(record.time, prepend=record.time[0]) > 1.0)
    wander = np.cumsum(rng.standard_normal(record.time.size)) * np.sqrt(step / 15)
    turn = order * np.cumsum(record.speed) * step + wander + 2 * np.pi * rng.random(loop.max() + 1)[loop]
    return _added(record, amplitude * record.torque / record.torque.mean() * np.sin(turn))


def ragged(record: Record, rng: np.random.Generator, jitter: float, lost: float) -> Record:
    """Samples a share of the interval off their time, and a share of them lost."""
    step = float(np.median(np.diff(record.time)))
    kept = rng.random(record.time.size) >= lost
    time = record.time + jitter * step * rng.standard_normal(record.time.size)
    return replace(record, time=time).take(kept)


def with_ripple(record: Record, amplitude: float, order: float, rate: float = RATE) -> Record:
    angle = np.cumsum(record.speed) / rate
    return _added(record, amplitude * np.sin(order * angle + 1.0))


def with_line(record: Record, amplitude: float, hertz: float, below: float = np.inf) -> Record:
    """A line of one frequency at sliding velocities below `below` m/s."""
    return _added(record, amplitude * np.sin(2 * np.pi * hertz * record.time) * (np.abs(record.speed) * RADIUS < below))


def _added(record: Record, torque: FloatArray) -> Record:
    return replace(record, torque=record.torque + torque)


def campaign(stationary: list[Record], dynamic: list[Record]) -> Campaign:
    """States a thousand cycles apart; plateaus are not looked at here."""
    one = Plateaus(pressure=np.full(1, 5e5), speed=np.ones(1), torque=np.ones(1))
    steady = [StationaryRun(run_id=f"s{i}", cycles=1e3 * i, plateaus=one, record=r) for i, r in enumerate(stationary)]
    moving = [DynamicRun(run_id=f"d{i}", cycles=1e3 * i, record=r) for i, r in enumerate(dynamic)]
    return Campaign(stationary=tuple(steady), dynamic=tuple(moving))
