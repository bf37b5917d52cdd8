"""Numbers, names and lists as the paragraph writes them."""

import math
from collections.abc import Sequence

from models.diagnosis.design import axes
from models.diagnosis.effects.estimate import Estimate

#: Digits after the point at most.
_DIGITS = 5

_AXES = {
    axes.PRESSURE: "pressure",
    axes.TORQUE: "the torque itself",
    axes.SPEED: "speed",
    axes.CYCLES: "cycles",
    axes.CLOCK: "the time since the test began",
    axes.TEMPERATURE: "oil temperature",
    axes.PHASE: "the phase of the loops",
    axes.FREQUENCY: "frequency, in the raw records",
}


def axis_name(axis: str) -> str:
    """An axis in words."""
    return _AXES.get(axis, axis)


def effect_name(slug: str) -> str:
    """A slug in words."""
    return slug.replace("_", " ")


def conjunction(parts: Sequence[str]) -> str:
    """`a`, `a and b`, `a, b and c`."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def count_of(number: int, noun: str) -> str:
    """`1 test`, `2 tests`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def probability(value: float) -> str:
    """Two digits; no certainty."""
    return "above 0.99" if value > 0.99 else "below 0.01" if value < 0.01 else f"{value:.2f}"


def with_unit(text: str, unit: str) -> str:
    """A number with its unit, if it has one."""
    return text if unit in {"-", ""} else f"{text} {unit}"


def estimated(estimate: Estimate) -> str:
    """Value and deviation to the deviation's second digit."""
    if not estimate.sd > 0:
        return with_unit(f"{estimate.name} {number(estimate.value)}", estimate.unit)
    digits = max(0, 1 - math.floor(math.log10(estimate.sd)))
    if digits > _DIGITS:
        return with_unit(f"{estimate.name} {number(estimate.value)} ± {number(estimate.sd)}", estimate.unit)
    value = _signed(f"{estimate.value:.{digits}f}")
    return with_unit(f"{estimate.name} {value} ± {estimate.sd:.{digits}f}", estimate.unit)


def signed(estimate: Estimate) -> str:
    """Value and deviation, and where the sign is open its probability."""
    sign = None if estimate.one_sided else estimate.sign_probability
    if sign is None:
        return estimated(estimate)
    way = "negative" if estimate.value < 0 else "positive"
    return f"{estimated(estimate)}, {way} with probability {probability(sign)}"


def number(value: float) -> str:
    """Three digits, without an exponent where that is readable."""
    if 100 <= abs(value) < 1e6:
        return _signed(f"{value:,.0f}")
    return _signed(f"{value:.3g}") if value == 0 or 1e-3 <= abs(value) < 100 else f"{value:.2e}"


def _signed(text: str) -> str:
    """With a minus that is no hyphen."""
    return text.replace("-", "−")
