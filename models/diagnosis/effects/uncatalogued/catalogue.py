"""Every uncatalogued rig fault that competes with the catalogue of effects; a new one is a file and a line here."""

from models.diagnosis.effects.uncatalogued import (
    gain_with_clock,
    gain_with_life,
    gauge_hysteresis,
    speed_hysteresis,
    speed_scale_step,
    static_torque_step,
    stribeck_velocity_step,
)
from models.diagnosis.effects.uncatalogued.fault import UncataloguedFault

UNCATALOGUED: tuple[UncataloguedFault, ...] = (
    gain_with_clock.FAULT,
    gain_with_life.FAULT,
    speed_scale_step.FAULT,
    static_torque_step.FAULT,
    stribeck_velocity_step.FAULT,
    gauge_hysteresis.FAULT,
    speed_hysteresis.FAULT,
)

UNCATALOGUED_BY_SLUG = {fault.effect.slug: fault for fault in UNCATALOGUED}
