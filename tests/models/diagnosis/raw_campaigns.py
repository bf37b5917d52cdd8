"""Campaigns of raw records with lines hidden in them, made without the product's own simulated rig."""

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.runs import Plateaus, Record

RPM = 2 * np.pi / 60
RADIUS = 0.058
RATE = 200.0
LEVELS = (4.0e5, 6.0e5)


def friction(speed: FloatArray, pressure: FloatArray) -> FloatArray:
    velocity = np.maximum(np.abs(speed) * RADIUS, 1e-9)
    return pressure / 25e3 * (1 - 0.4 * np.exp(-1.5 / velocity)) + 2 * velocity**0.3


def noise(rng: np.random.Generator, size: int, memory: float = 0.8, deviation: float = 0.2) -> FloatArray:
    innovations = rng.standard_normal(size)
    return deviation * lfilter([np.sqrt(1 - memory**2)], [1, -memory], innovations)


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


def with_ripple(record: Record, amplitude: float, order: float) -> Record:
    angle = np.cumsum(record.speed) / RATE
    return _added(record, amplitude * np.sin(order * angle + 1.0))


def with_line(record: Record, amplitude: float, hertz: float, below: float = np.inf) -> Record:
    """A line of one frequency at sliding velocities below `below` m/s."""
    return _added(record, amplitude * np.sin(2 * np.pi * hertz * record.time) * (np.abs(record.speed) * RADIUS < below))


def _added(record: Record, torque: FloatArray) -> Record:
    return Record(time=record.time, pressure=record.pressure, speed=record.speed, torque=record.torque + torque)


def campaign(stationary: list[Record], dynamic: list[Record]) -> Campaign:
    """States a thousand cycles apart; plateaus are not looked at here."""
    one = Plateaus(pressure=np.full(1, 5e5), speed=np.ones(1), torque=np.ones(1))
    return Campaign(
        stationary=tuple(
            StationaryRun(run_id=f"s{i}", cycles=1000.0 * i, plateaus=one, record=record)
            for i, record in enumerate(stationary)
        ),
        dynamic=tuple(DynamicRun(run_id=f"d{i}", cycles=1000.0 * i, record=record) for i, record in enumerate(dynamic)),
    )
