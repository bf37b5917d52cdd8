"""Temperatures of the simulated rig: what the oil's does to torque, and what the reaction plate's thermometer shows.

By Hersey's similarity, friction depends on speed times viscosity: warmer, thinner oil acts like a lower speed.

    M(v, p, T) = M_measured · S(v ν(T)/ν₀, p, ζ) / S(v, p, ζ),      ν(T)/ν₀ = exp(B/(T - C) - B/(T₀ - C))

with Vogel's viscosity. The rig's own torque does not depend on the temperature that it records: this adds the effect. The
plate is as warm as the heat flux of friction makes it,

    T_plate = T_oil + ΔT q/q_0,    q = |M ω|/A,    q_0 = 0.32 W/mm²

at once, for it is thin, and in counts of 0.1 K. A rise ΔT of 0 is a plate that its oil keeps at the oil's temperature.

Source: M. D. Hersey, J. Wash. Acad. Sci. 4 (1914) 542-552; H. Vogel, Phys. Z. 22 (1921) 645-646. The constants are chosen
so that viscosity falls by some 22 % from 80 to 90 °C. The plate is this project's; the reference measures none.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.stribeck import torque
from models.records.runs import Plateaus, Record
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import OIL_TEMPERATURE, rounded
from models.rig.truth import OPEN, SimulatedClutch

#: The flux [W/m²] at which a plate's rise and a loss by heating have their sizes.
REFERENCE_FLUX = 0.32e6

Held = TypeVar("Held", Plateaus, Record)


def warmed(held: Held, clutch: SimulatedClutch, wear: float, strength: float = 1.0) -> Held:
    """A simulated test's plateaus or record with `warm_torque`."""
    return replace(held, torque=warm_torque(held, clutch, wear, strength))


def warm_torque(held: Plateaus | Record, clutch: SimulatedClutch, wear: float, strength: float) -> FloatArray:
    """Torque [n] Nm of a simulated test, changed by its oil's temperature; `wear` is the ζ at which it was made.

    `strength` [-] is the power of the viscosity's ratio. Raises ValueError where no oil temperature was recorded.
    """
    if held.oil_temperature is None:
        raise ValueError("a test must have an oil_temperature, got None")
    b, c = 880.0, 170.0  # Vogel's [K]
    thinner = np.exp(strength * (b / (held.oil_temperature - c) - b / (OIL_TEMPERATURE - c)))
    velocity = clutch.geometry.sliding_velocity(held.speed)
    at = clutch.parameters(np.maximum(held.pressure, OPEN), wear)
    return held.torque * torque(velocity * thinner, at) / torque(velocity, at)


def heat_flux(held: Plateaus | Record, geometry: Geometry) -> FloatArray:
    """Heat flux q [n] W/m², the power that the faces turn into heat over their area."""
    return np.asarray(np.abs(held.torque * held.speed) / (geometry.lining_area * geometry.friction_faces))


def with_plate(run: SimulatedRun, geometry: Geometry, rise: float) -> SimulatedRun:
    """A run whose channels have the plate's temperature, `rise` >= 0 K above the oil at 0.32 W/mm²; others as they are."""

    def temperature(held: Plateaus | Record) -> FloatArray:
        oil = OIL_TEMPERATURE if held.oil_temperature is None else held.oil_temperature
        return oil + rounded(rise * heat_flux(held, geometry) / REFERENCE_FLUX, 10.0)

    if run.record is not None:
        return replace(run, record=replace(run.record, plate_temperature=temperature(run.record)))
    if run.plateaus is not None:
        return replace(run, plateaus=replace(run.plateaus, plate_temperature=temperature(run.plateaus)))
    return run
