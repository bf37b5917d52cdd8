"""A rig that measures without error."""

from models.rig.sampled import Recorder
from models.rig.stationary import Sensor

NOISELESS = Sensor(noise=0.0, floor=0.0, gain_scatter=0.0, torque_counts=0.0, temperature_counts=0.0)
EXACT = Recorder(
    torque_noise=0.0, speed_noise=0.0, pressure_noise=0.0, torque_counts=0.0, speed_counts=0.0, pressure_counts=0.0
)
