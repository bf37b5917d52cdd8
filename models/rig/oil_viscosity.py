"""The effect of the oil's temperature on a simulated clutch's torque, for campaigns in which it is to be identified.

By Hersey's similarity, friction depends on speed times viscosity: warmer, thinner oil acts like a lower speed.

    M(v, p, T) = M_measured · S(v ν(T)/ν₀, p, ζ) / S(v, p, ζ),      ν(T)/ν₀ = exp(B/(T - C) - B/(T₀ - C))

with Vogel's viscosity. The rig's own torque does not depend on the temperature that it records: this adds the effect.

Source: M. D. Hersey, J. Wash. Acad. Sci. 4 (1914) 542-552; H. Vogel, Phys. Z. 22 (1921) 645-646. The constants are chosen
so that viscosity falls by some 22 % from 80 to 90 °C.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from models.friction.stribeck import torque
from models.records.runs import Plateaus, Record
from models.rig.stationary import OIL_TEMPERATURE
from models.rig.truth import OPEN, SimulatedClutch

#: Vogel's B and C [K].
_B, _C = 880.0, 170.0

Held = TypeVar("Held", Plateaus, Record)


def warmed(held: Held, clutch: SimulatedClutch, wear: float, strength: float = 1.0) -> Held:
    """A simulated test's plateaus or record as its oil's temperature makes them; `wear` is the ζ at which it was made.

    `strength` [-] is the power of the viscosity's ratio. Raises ValueError where no oil temperature was recorded.
    """
    if held.oil_temperature is None:
        raise ValueError("a test must have an oil_temperature, got None")
    thinner = np.exp(strength * (_B / (held.oil_temperature - _C) - _B / (OIL_TEMPERATURE - _C)))
    velocity = clutch.geometry.sliding_velocity(held.speed)
    at = clutch.parameters(np.maximum(held.pressure, OPEN), wear)
    return replace(held, torque=held.torque * torque(velocity * thinner, at) / torque(velocity, at))
