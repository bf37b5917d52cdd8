"""What can be hidden: a maker and what it needs of the protocol, by slug; the catalogue's seventeen and others."""

from collections.abc import Callable

import numpy as np

from tests.blind.rig import ageing, moving, outside, steady
from tests.blind.rig.plan import Plan, Wish
from tests.blind.rig.world import Effect

Maker = Callable[[np.random.Generator, Plan], Effect]

HISTORY = frozenset({"running_in", "oil_change", "accelerated_wear", "load_severity"})

CATALOGUED: dict[str, tuple[Maker, Wish]] = {
    "oil_temperature": (steady.oil_temperature, Wish(oil=True)),
    "interface_heating": (steady.interface_heating, Wish()),
    "viscous_exponent": (steady.viscous_exponent, Wish()),
    "hydrodynamic_drag": (steady.hydrodynamic_drag, Wish()),
    "torque_zero_shift": (steady.torque_zero_shift, Wish(oil=True, moments=True)),
    "pressure_offset": (steady.pressure_offset, Wish()),
    "unsettled_dwell": (steady.unsettled_dwell, Wish()),
    "channel_delay": (moving.channel_delay, Wish()),
    "inertia_torque": (moving.inertia_torque, Wish()),
    "squeeze_film": (moving.squeeze_film, Wish()),
    "shaft_ripple": (moving.shaft_ripple, Wish(rate=200.0)),
    "stick_slip": (moving.stick_slip, Wish(rate=200.0)),
    "running_in": (ageing.running_in, Wish(early=True)),
    "oil_change": (ageing.oil_change, Wish(event="oil_change")),
    "accelerated_wear": (ageing.accelerated_wear, Wish()),
    "load_severity": (ageing.load_severity, Wish(energy=True)),
    "rest_recovery": (steady.rest_recovery, Wish(moments=True, pauses=True)),
}

OUTSIDE: dict[str, tuple[Maker, Wish]] = {
    "speed_bump": (outside.speed_bump, Wish()),
    "clock_wobble": (outside.clock_wobble, Wish()),
    "bent_sensor": (outside.bent_sensor, Wish()),
    "pressure_way": (outside.pressure_way, Wish(both_ways=True)),
    "seasons": (outside.seasons, Wish()),
    "resonance": (outside.resonance, Wish()),
    "clogging": (outside.clogging, Wish()),
    "braking": (outside.braking, Wish()),
}

ALL = CATALOGUED | OUTSIDE
