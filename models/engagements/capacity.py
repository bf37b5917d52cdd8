"""What a closed clutch can transfer, by its Stribeck parameters at the pressures where they are known."""

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from models.friction.criteria import FEWEST_PRESSURES
from models.friction.pressure_laws import laws_of
from models.friction.stribeck import StribeckParameters, torque

#: Torque [Nm] of the closed clutch at line pressure [Pa] and sliding velocity [m/s] >= 0.
Capacity: TypeAlias = Callable[[float, float], float]


def capacity_of(parameters: Mapping[float, StribeckParameters]) -> Capacity:
    """Eq. 3 over pressure and velocity, from the parameters by pressure [Pa], one pressure or more.

    From FEWEST_PRESSURES on the pressure laws of fig. 9 go through them; with fewer, torque goes with pressure from the
    nearest one. Below the lowest pressure torque goes with pressure.
    """
    levels = np.array(sorted(parameters))
    columns = np.stack([parameters[level].as_array() for level in levels.tolist()])
    laws = laws_of(levels, columns) if levels.size >= FEWEST_PRESSURES else None

    def capacity(pressure: float, velocity: float) -> float:
        curve_pressure = max(pressure, float(levels[0]))
        if laws is None:
            curve_pressure = float(levels[np.argmin(np.abs(levels - pressure))])
            curve = parameters[curve_pressure]
        else:
            curve = laws.parameters(np.array(curve_pressure))
        return float(torque(np.array(velocity), curve)) * pressure / curve_pressure

    return capacity
