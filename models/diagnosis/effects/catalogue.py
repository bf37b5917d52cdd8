"""The catalogue: every effect that the diagnosis can name, in the contract's order."""

from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.catalogued import (
    accelerated_wear,
    channel_delay,
    hydrodynamic_drag,
    inertia_torque,
    interface_heating,
    load_severity,
    oil_change,
    oil_temperature,
    pressure_offset,
    rest_recovery,
    running_in,
    shaft_ripple,
    squeeze_film,
    stick_slip,
    torque_zero_shift,
    unsettled_dwell,
    viscous_exponent,
)
from models.diagnosis.effects.effect import Effect, sized

CATALOGUE: tuple[Effect, ...] = (
    oil_temperature.EFFECT,
    interface_heating.EFFECT,
    viscous_exponent.EFFECT,
    hydrodynamic_drag.EFFECT,
    torque_zero_shift.EFFECT,
    pressure_offset.EFFECT,
    unsettled_dwell.EFFECT,
    channel_delay.EFFECT,
    inertia_torque.EFFECT,
    squeeze_film.EFFECT,
    shaft_ripple.EFFECT,
    stick_slip.EFFECT,
    running_in.EFFECT,
    oil_change.EFFECT,
    accelerated_wear.EFFECT,
    load_severity.EFFECT,
    rest_recovery.EFFECT,
)

BY_SLUG = {effect.slug: effect for effect in CATALOGUE}


def effects_for(facts: Facts, without: frozenset[str] = frozenset()) -> list[Effect]:
    """The effects with the priors that fit this campaign's clutch; those whose slugs are in `without` are left out."""
    return [sized(effect, facts) for effect in CATALOGUE if effect.slug not in without]
