"""The simulated rig's recorder adds noise, counts, losses and spikes to a course of pressure, speed and torque.

Torque noise is a first-order autoregression of `memory` seconds. The gain is one number a run, as for plateaus.

Source: this project's; the reference says which channels are recorded (section 2.1) and not how well.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray, require_finite
from models.friction.speed_protocol import RPM
from models.records.runs import Record
from models.rig.stationary import OIL_TEMPERATURE, Sensor, oil_temperature, rounded


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorder:
    """Deviations of a sample: torque [Nm] (with `memory` [s]), speed [rad/s], pressure [Pa]; counts [1/unit], 0: none.

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
        kept = slice(None) if self.lost == 0 else rng.random(count) >= self.lost
        at, p, w, m, oil = (column[kept] for column in columns)
        return Record(time=at, pressure=p, speed=w, torque=m, oil_temperature=oil)


EXACT = Recorder(
    torque_noise=0.0, speed_noise=0.0, pressure_noise=0.0, torque_counts=0.0, speed_counts=0.0, pressure_counts=0.0
)


def _coloured(white: FloatArray, memory: float, step: float) -> FloatArray:
    """Noise [n] of unit deviation whose correlation falls by e in `memory` s, from white noise [n]."""
    kept = math.exp(-step / memory) if memory > 0 else 0.0
    entering = white * math.sqrt(1 - kept * kept)
    entering[:1] = white[:1]
    return np.asarray(lfilter([1.0], [1.0, -kept], entering), dtype=np.float64)
