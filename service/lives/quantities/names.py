"""The quantities that are followed along a life: their public names, units, and what they are measured at."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from service.columns import bar
from service.errors import FieldError, InvalidError
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF
from service.lives.engagements.over_life import ALL_INDICATORS
from service.lives.history import Series
from service.lives.payloads import PARAMETER_UNITS
from service.schemas.prognosis.quantities import ALIASES


class Family(StrEnum):
    """What a quantity comes from: mean COF, a fitted parameter, a curve's slope, a friction loop, an engagement."""

    MEAN_COF = "mean_cof"
    PARAMETER = "parameter"
    SLOPE = "slope"
    LAG = "lag"
    ENGAGEMENT = "engagement"


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity by its public name, the name that series of it have, its unit and its family."""

    name: str
    internal: str
    unit: str
    family: Family


SLOPE = "slope"
#: The speeds [rpm] at which slopes are stated where nothing else is said. Chosen: where a driveline shudders, creeping.
SLOPE_SPEEDS = (50.0, 100.0, 500.0)

QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity(name=MEAN_COF, internal=MEAN_COF, unit="1", family=Family.MEAN_COF),
        *(
            Quantity(name=public, internal=internal, unit=unit, family=Family.PARAMETER)
            for internal, (public, unit) in PARAMETER_UNITS.items()
        ),
        Quantity(name=SLOPE, internal=SLOPE, unit="s/m", family=Family.SLOPE),
        Quantity(name="attractor", internal="attractor", unit="Nm/s", family=Family.LAG),
        Quantity(name="film_time", internal="film_time", unit="s", family=Family.LAG),
        Quantity(name="loop_area", internal="loop_area", unit="Nm·m/s", family=Family.LAG),
        *(
            Quantity(name=name, internal=name, unit=indicator.unit, family=Family.ENGAGEMENT)
            for name, indicator in ALL_INDICATORS.items()
        ),
    )
}
_BY_INTERNAL = {quantity.internal: quantity for quantity in QUANTITIES.values()}


def quantity_named(name: str) -> Quantity:
    """The quantity of a public name, of another name that criteria may have, or of a parameter's name without its unit.

    Raises InvalidError for any other.
    """
    quantity = QUANTITIES.get(ALIASES.get(name, name)) or _BY_INTERNAL.get(name)
    if quantity is None:
        message = f"quantity must be one of {', '.join(QUANTITIES)}, got {name!r}"
        raise InvalidError(message, errors=[FieldError(pointer="/query/quantity", code="unknown", message=message)])
    return quantity


def place_of(series: Series) -> dict[str, float | None]:
    """Where a series was measured, as answers show it; null: over all pressures, or at no speed or frequency of its own."""
    pressure = None if series.pressure == ALL_PRESSURES else bar(series.pressure)
    return {"pressure_bar": pressure, "speed_rpm": series.speed_rpm, "frequency_hz": series.frequency_hz}
