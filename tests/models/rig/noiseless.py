"""What the simulated stationary test gives without noise."""

import numpy as np

from models.records.runs import curves_by_pressure
from models.rig.stationary import NOISELESS, stationary_test

BAR = 1e5


def curves(clutch, cycles):
    """Noiseless torque [40] at each pressure in bar, through the simulated test itself."""
    plateaus = stationary_test(clutch, cycles, np.random.default_rng(0), NOISELESS)
    return {c.pressure / BAR: c.torque for c in curves_by_pressure(plateaus, clutch.geometry)}
