"""A static torque that steps at a cycle."""

from models.diagnosis.design.axes import CYCLES
from models.diagnosis.effects.uncatalogued.fault import uncatalogued_fault
from models.diagnosis.effects.uncatalogued.steps import onset_grid, parameter_step

FAULT = uncatalogued_fault(
    slug="static_torque_step",
    description="a static torque that steps at a cycle",
    formula="a M_s ∂S/∂M_s from a cycle on",
    axis=CYCLES,
    grid=onset_grid,
    change=parameter_step("static_torque"),
    shapes=1,
)
