"""The sampled records of the simulated rig: the dynamic Stribeck test, the raw stationary test, one engagement.

**Dynamic** (section 2.3.4): a sinusoidal speed, 0.1 Hz, offset and amplitude 1000 rpm, for 15 s at each pressure; it swings
on while the pressure goes to the next. **Raw stationary** (section 2.3.3): 7 x 40 dwells of 5 s,
speed and pressure approaching each exponentially as their controllers let them. In both, torque comes from the clutch's
moving torque, so that the transient after a step is that of its lag. The rates and controllers are assumed.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, sections 2.3.3 and 2.3.4.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from models.arrays import FloatArray, require_finite
from models.engagements.simulation import Engagement
from models.friction.speed_protocol import REFERENCE_SPEEDS, RPM
from models.records.runs import Record
from models.rig.recorder import Recorder
from models.rig.stationary import OIL_TEMPERATURE, PLATEAU_DURATION, Sensor
from models.rig.truth import OPEN, PROTOCOL_PRESSURES, SimulatedClutch

#: The protocol's pressures [Pa].
PROTOCOL = tuple(PROTOCOL_PRESSURES.tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicTest:
    """`frequency` [Hz], `offset` and `amplitude` [rad/s] of speed, `duration` at a pressure and `step` to the next [s],
    `rate` [Hz]; `pressures` [Pa] in their order, the protocol's unless given. Raises ValueError unless all are positive and
    the speed never falls below zero.
    """

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
        """Time [n] s, pressure [n] Pa and speed [n] rad/s as they are commanded."""
        block, last = self.duration + self.step, len(self.pressures) - 1
        time = np.arange(math.floor((block * last + self.duration) * self.rate)) / self.rate
        turn = np.minimum((time / block).astype(np.int64), last)
        passed = np.clip((time - turn * block - self.duration) / self.step, 0.0, 1.0)
        pressure = np.interp(turn + passed, np.arange(last + 1), self.pressures)
        return time, pressure, self.offset + self.amplitude * np.sin(2 * math.pi * self.frequency * time)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawTest:
    """`rate` [Hz] of the raw stationary record; `controller` [s] is the time in which speed and pressure come to 1/e of
    a step, `dwell` [s] what a plateau lasts; `pressures` [Pa] as for the dynamic test. Raises ValueError
    unless all are positive."""

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
        """Time [n] s, pressure [n] Pa and speed [n] rad/s as the controllers bring them about."""
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
    """What the recorder makes of one engagement."""
    return Recorder().record(trace.time, trace.pressure, trace.speed, trace.torque, rng, sensor)
