"""The stationary Stribeck test of the simulated rig (section 2.3.3): a clutch held on 7 x 40 plateaus, 5 s each.

The measured torque of plateau i is simulated as

    M_i = g S(v_i, p_i) (1 + s η_i) + f ν_i ,    g = 1 + r κ,    η_i, ν_i, κ standard normal

with sensor noise s, additive floor f and a gain g that is one number a run, rounded to the recorder's counts. Oil
temperature is recorded and swings about its set point as under a thermostat; it does not act on the torque.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray, require_finite
from models.friction.speed_protocol import REFERENCE_SPEEDS
from models.friction.stribeck import torque
from models.records.runs import Plateaus
from models.rig.truth import OPEN, PROTOCOL_PRESSURES, SimulatedClutch

#: Time on one plateau [s] (section 2.3.3).
PLATEAU_DURATION = 5.0
#: Middle of the range in which the oil is kept, 80 to 90 °C [K].
OIL_TEMPERATURE = 273.15 + 85.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """The measurement errors of the simulated rig. Everything is >= 0, and a zero switches its part off.

    `noise` [-] of torque a plateau, `floor` [Nm] added to that, `gain_scatter` [-] of torque from run to run (all
    standard deviations), `torque_counts` [1/Nm] and `temperature_counts` [1/K] of the recorder. Raises ValueError on
    negative or not finite values.
    """

    noise: float = 0.01
    floor: float = 0.02
    gain_scatter: float = 0.002
    torque_counts: float = 1000.0
    temperature_counts: float = 10.0

    def __post_init__(self) -> None:
        require_finite(self, self.__slots__)


#: A sensor that gives the reference's errors of fit: the percentage MSE (eq. 5) of fresh curves is 1.5 % on average over
#: drawn clutches, where fig. 8's is 1.74 %. It grows as the noise squared over the curve's own variance, so that the nearly
#: flat curves at 4 and 4.5 bar have most of it. A raw record's plateaus are as exact. Chosen among noises of 0.2 to 1 %.
SHARP = Sensor(noise=0.002, floor=0.01)


def stationary_test(
    clutch: SimulatedClutch,
    cycles: float,
    rng: np.random.Generator,
    sensor: Sensor | None = None,
    pressures: FloatArray = PROTOCOL_PRESSURES,
    speeds: FloatArray = REFERENCE_SPEEDS,
    oil: float = OIL_TEMPERATURE,
) -> Plateaus:
    """Plateaus of one simulated stationary test after cycles >= 0 at pressures [p] Pa and speeds [s] rad/s: p s rows,
    by pressure.

    The oil is kept at `oil` [K].

    Every random number is drawn whatever the sensor, so that two sensors measure the same test.
    """
    sensor = Sensor() if sensor is None else sensor
    true = torque(
        clutch.geometry.sliding_velocity(speeds),
        clutch.parameters(np.maximum(pressures, OPEN)[:, np.newaxis], cycles),
    ).ravel()
    gain = 1.0 + sensor.gain_scatter * float(rng.standard_normal())
    relative, added = rng.standard_normal((2, true.size))
    measured = gain * true * (1.0 + sensor.noise * relative) + sensor.floor * added
    return Plateaus(
        pressure=np.repeat(pressures, speeds.size),
        speed=np.tile(speeds, pressures.size),
        torque=rounded(measured, sensor.torque_counts),
        oil_temperature=oil_temperature(
            np.arange(0.0, PLATEAU_DURATION * true.size, PLATEAU_DURATION), rng, sensor, oil
        ),
    )


def oil_temperature(
    time: FloatArray, rng: np.random.Generator, sensor: Sensor, kept_at: float = OIL_TEMPERATURE
) -> FloatArray:
    """Oil temperature [n] K at time [n] s: a swing of the thermostat by at most 4.5 K, in the recorder's counts."""
    amplitude, period = rng.uniform(0.4, 1.0) * 4.5, rng.uniform(600.0, 1500.0)
    phase = rng.uniform(0.0, 2 * math.pi)
    swing = amplitude * np.sin(2 * math.pi * time / period + phase)
    return kept_at + rounded(swing, sensor.temperature_counts)


def rounded(values: FloatArray, counts: float) -> FloatArray:
    """Values [n] to the nearest of a recorder's counts [1/unit]; as they are where counts is 0."""
    return np.asarray(values if counts == 0 else np.round(values * counts) / counts, dtype=np.float64)
