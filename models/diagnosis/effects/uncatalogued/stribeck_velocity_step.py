"""A Stribeck velocity that steps at a cycle."""

from models.diagnosis.design.axes import CYCLES
from models.diagnosis.effects.uncatalogued.fault import uncatalogued_fault
from models.diagnosis.effects.uncatalogued.steps import onset_grid, parameter_step

FAULT = uncatalogued_fault(
    slug="stribeck_velocity_step",
    description="a Stribeck velocity that steps at a cycle",
    formula="a V_S ∂S/∂V_S from a cycle on",
    axis=CYCLES,
    grid=onset_grid,
    change=parameter_step("stribeck_velocity"),
    shapes=1,
)
