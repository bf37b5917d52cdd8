"""The sampled records of the simulated rig: the dynamic Stribeck test, the raw stationary test, one engagement.

**Dynamic** (section 2.3.4): a sinusoidal speed, 0.1 Hz, offset and amplitude 1000 rpm, for 15 s at each pressure; it swings
on while the pressure goes to the next. **Raw stationary** (section 2.3.3): 7 x 40 dwells of 5 s, speed and pressure
approaching each exponentially as their controllers let them. In both, torque comes from the clutch's moving torque, so that
the transient after a step is that of its lag. The rates and controllers are assumed.

The recorder adds noise, counts, losses and spikes to a course of pressure, speed and torque. Torque noise is a first-order
autoregression of `memory` seconds; the gain is one number a run, as for plateaus. It is this project's: the reference says
which channels are recorded (section 2.1) and not how well.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray, require_finite
from models.engagements.simulation import Engagement
from models.friction.speed_protocol import REFERENCE_SPEEDS, RPM
from models.records.runs import Record
from models.rig.stationary import OIL_TEMPERATURE, PLATEAU_DURATION, Sensor, oil_temperature, rounded
from models.rig.truth import OPEN, PROTOCOL_PRESSURES, SimulatedClutch


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorder:
    """The errors of the recorder: deviations of a sample of torque [Nm] (with `memory` [s]), speed [rad/s], pressure
    [Pa]; counts [1/unit], 0: none.

    `lost` is the share of samples that are missing, `spikes_per_minute` how often torque has a spike. Raises
    ValueError on negative or not finite values and where lost is not below 1.
    """

    torque_noise: float = 0.05
    memory: float = 0.005
    speed_noise: float = 0.5 * RPM
    pressure_noise: float = 500.0
    torque_counts: float = 200.0
    speed_counts: float = 10.0 / RPM
    pressure_counts: float = 1000.0 / 1e5
    lost: float = 0.0
    spikes_per_minute: float = 0.0

    def __post_init__(self) -> None:
        require_finite(self, self.__slots__)
        if self.lost >= 1:
            raise ValueError(f"lost must be below 1, got {self.lost}")

    def record(
        self,
        time: FloatArray,
        pressure: FloatArray,
        speed: FloatArray,
        torque: FloatArray,
        rng: np.random.Generator,
        sensor: Sensor,
        kept_at: float = OIL_TEMPERATURE,
    ) -> Record:
        """The record of a course [n], evenly sampled: time in s, pressure in Pa, speed in rad/s, torque in Nm.

        `sensor` gives the run's gain and the counts of temperature; the oil is kept at `kept_at` [K].
        """
        count = time.size
        step = float(time[1] - time[0]) if count > 1 else 0.0
        gain = 1.0 + sensor.gain_scatter * float(rng.standard_normal())
        measured = gain * torque + self.torque_noise * _coloured(rng.standard_normal(count), self.memory, step)
        spikes = rng.poisson(self.spikes_per_minute * step * count / 60)
        measured[rng.integers(0, count, spikes)] += rng.choice([-1.0, 1.0], spikes) * rng.uniform(5.0, 50.0, spikes)
        columns = (
            time,
            rounded(pressure + self.pressure_noise * rng.standard_normal(count), self.pressure_counts),
            rounded(speed + self.speed_noise * rng.standard_normal(count), self.speed_counts),
            rounded(measured, self.torque_counts),
            oil_temperature(time, rng, sensor, kept_at),
        )
        is_kept = slice(None) if self.lost == 0 else rng.random(count) >= self.lost
        at, p, w, m, oil = (column[is_kept] for column in columns)
        return Record(time=at, pressure=p, speed=w, torque=m, oil_temperature=oil)


def _coloured(white: FloatArray, memory: float, step: float) -> FloatArray:
    """Noise [n] of unit deviation whose correlation falls by e in `memory` s, from white noise [n]."""
    correlation = math.exp(-step / memory) if memory > 0 else 0.0
    entering = white * math.sqrt(1 - correlation * correlation)
    entering[:1] = white[:1]
    return np.asarray(lfilter([1.0], [1.0, -correlation], entering), dtype=np.float64)


#: The protocol's pressures [Pa].
PROTOCOL = tuple(PROTOCOL_PRESSURES.tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicTest:
    """The settings of a dynamic test: `frequency` [Hz], `offset` and `amplitude` [rad/s] of speed, `duration` at a
    pressure and `step` to the next [s], `rate` [Hz]; `pressures` [Pa] in their order, the protocol's unless given.
    Raises ValueError unless all are positive and the speed never falls below zero."""

    frequency: float = 0.1
    offset: float = 1000 * RPM
    amplitude: float = 1000 * RPM
    duration: float = 15.0
    step: float = 0.1
    rate: float = 100.0
    recorder: Recorder = field(default_factory=Recorder)
    pressures: tuple[float, ...] = PROTOCOL

    def __post_init__(self) -> None:
        require_finite(self, ("frequency", "offset", "amplitude", "duration", "step", "rate"), positive=True)
        if self.amplitude > self.offset:
            raise ValueError(f"amplitude must not exceed offset {self.offset}, got {self.amplitude}")

    def course(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Commanded time [n] s, pressure [n] Pa and speed [n] rad/s."""
        block, last = self.duration + self.step, len(self.pressures) - 1
        time = np.arange(math.floor((block * last + self.duration) * self.rate)) / self.rate
        turn = np.minimum((time / block).astype(np.int64), last)
        passed = np.clip((time - turn * block - self.duration) / self.step, 0.0, 1.0)
        pressure = np.interp(turn + passed, np.arange(last + 1), self.pressures)
        return time, pressure, self.offset + self.amplitude * np.sin(2 * math.pi * self.frequency * time)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawTest:
    """The settings of a raw stationary record: sampling `rate` [Hz], `controller` time constant [s] of speed and
    pressure, duration `dwell` [s] of a plateau; `pressures` [Pa] as for the dynamic test. Raises ValueError unless all
    are positive."""

    rate: float = 1000.0
    controller: float = 0.1
    dwell: float = PLATEAU_DURATION
    recorder: Recorder = field(
        default_factory=lambda: Recorder(torque_noise=0.25, memory=0.02, speed_noise=1.0 * RPM, pressure_noise=1000.0)
    )
    pressures: tuple[float, ...] = PROTOCOL

    def __post_init__(self) -> None:
        require_finite(self, ("rate", "controller", "dwell"), positive=True)

    def course(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Time [n] s, pressure [n] Pa and speed [n] rad/s, with the controllers' lag."""
        pressure = np.repeat(self.pressures, REFERENCE_SPEEDS.size)
        speed = np.tile(REFERENCE_SPEEDS, len(self.pressures))
        time = np.arange(math.floor(self.dwell * speed.size * self.rate)) / self.rate
        step = np.minimum((time / self.dwell).astype(np.int64), speed.size - 1)
        left = np.exp(-(time - step * self.dwell) / self.controller)
        before = np.maximum(step - 1, 0)
        pressure, speed = (level[step] + (level[before] - level[step]) * left for level in (pressure, speed))
        return time, pressure, speed


def sampled_test(
    clutch: SimulatedClutch,
    cycles: float,
    test: DynamicTest | RawTest,
    rng: np.random.Generator,
    sensor: Sensor,
    oil: float = OIL_TEMPERATURE,
) -> Record:
    """The record of a dynamic test or of a raw stationary one, after cycles >= 0, with the oil kept at `oil` [K]."""
    time, pressure, speed = test.course()
    velocity = clutch.geometry.sliding_velocity(speed)
    torque = clutch.moving_torque(time, velocity, np.maximum(pressure, OPEN), cycles)
    return test.recorder.record(time, pressure, speed, torque, rng, sensor, oil)


def engagement_record(trace: Engagement, rng: np.random.Generator, sensor: Sensor) -> Record:
    """The record of one engagement, with the recorder's noise and counts."""
    return Recorder().record(trace.time, trace.pressure, trace.speed, trace.torque, rng, sensor)
