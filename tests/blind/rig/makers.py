"""What can be hidden: a maker and what it needs of the protocol, by slug; the catalogue's seventeen and others."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.blind.rig import ageing, moving, outside, steady
from tests.blind.rig.plan import Plan
from tests.blind.rig.world import Effect

Maker = Callable[[np.random.Generator, Plan], Effect]
#: Fields of a `Wish`.
Wanted = dict[str, Any]

HISTORY = frozenset({"running_in", "oil_change", "accelerated_wear", "load_severity"})

CATALOGUED: dict[str, tuple[Maker, Wanted]] = {
    "oil_temperature": (steady.oil_temperature, {"oil": True}),
    "interface_heating": (steady.interface_heating, {}),
    "viscous_exponent": (steady.viscous_exponent, {}),
    "hydrodynamic_drag": (steady.hydrodynamic_drag, {}),
    "torque_zero_shift": (steady.torque_zero_shift, {"oil": True, "moments": True}),
    "pressure_offset": (steady.pressure_offset, {}),
    "unsettled_dwell": (steady.unsettled_dwell, {}),
    "channel_delay": (moving.channel_delay, {}),
    "inertia_torque": (moving.inertia_torque, {}),
    "squeeze_film": (moving.squeeze_film, {}),
    "shaft_ripple": (moving.shaft_ripple, {"rate": 200.0}),
    "stick_slip": (moving.stick_slip, {"rate": 200.0}),
    "running_in": (ageing.running_in, {"early": True}),
    "oil_change": (ageing.oil_change, {"event": "oil_change"}),
    "accelerated_wear": (ageing.accelerated_wear, {}),
    "load_severity": (ageing.load_severity, {"energy": True}),
    "rest_recovery": (steady.rest_recovery, {"moments": True, "pauses": True}),
}

OUTSIDE: dict[str, tuple[Maker, Wanted]] = {
    "speed_bump": (outside.speed_bump, {}),
    "clock_wobble": (outside.clock_wobble, {}),
    "bent_sensor": (outside.bent_sensor, {}),
    "pressure_way": (outside.pressure_way, {"both_ways": True}),
    "seasons": (outside.seasons, {}),
    "resonance": (outside.resonance, {}),
    "clogging": (outside.clogging, {}),
    "braking": (outside.braking, {}),
}

ALL = CATALOGUED | OUTSIDE
