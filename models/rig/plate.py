"""The reaction plate of the simulated rig, and its thermometer: as warm as the heat flux of friction makes it.

    T_plate = T_oil + ΔT q/q_0,    q = |M ω|/A,    q_0 = 0.32 W/mm²

at once, for it is thin, and in counts of 0.1 K. A rise ΔT of 0 is a plate that its oil keeps at the oil's temperature.

Source: this project's; the reference measures no plate.
"""

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.records.runs import Plateaus, Record
from models.rig.simulated_runs import SimulatedRun
from models.rig.stationary import OIL_TEMPERATURE, rounded

#: The flux [W/m²] at which a plate's rise and a loss by heating have their sizes.
REFERENCE_FLUX = 0.32e6
#: Of the thermometer [1/K].
_COUNTS = 10.0


def heat_flux(held: Plateaus | Record, geometry: Geometry) -> FloatArray:
    """q [n] W/m², the power that the faces turn into heat over their area."""
    area = 0.25 * np.pi * (geometry.outer_diameter**2 - geometry.inner_diameter**2) * geometry.friction_faces
    return np.asarray(np.abs(held.torque * held.speed) / area, dtype=np.float64)


def with_plate(run: SimulatedRun, geometry: Geometry, rise: float) -> SimulatedRun:
    """A run whose channels have the plate's temperature, `rise` >= 0 K above the oil at 0.32 W/mm²; others as they are."""

    def temperature(held: Plateaus | Record) -> FloatArray:
        oil = OIL_TEMPERATURE if held.oil_temperature is None else held.oil_temperature
        return oil + rounded(rise * heat_flux(held, geometry) / REFERENCE_FLUX, _COUNTS)

    if run.record is not None:
        return replace(run, record=replace(run.record, plate_temperature=temperature(run.record)))
    if run.plateaus is not None:
        return replace(run, plateaus=replace(run.plateaus, plate_temperature=temperature(run.plateaus)))
    return run
