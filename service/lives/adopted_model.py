"""What an adopted diagnosis changes in tracking, ready to be used."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from sqlalchemy import Connection

from models.arrays import FloatArray

#: Mean COF [m] that an adopted model's effects add at cycles since new [m], at a pressure [Pa], 0 = the mean over the
#: reference pressures.
Course: TypeAlias = Callable[[FloatArray, float], FloatArray]

BASELINE: Mapping[str, Any] = {"name": "baseline", "effects": []}


@dataclass(frozen=True, slots=True, kw_only=True)
class Adopted:
    """The model as answers name it, its course (None: eq. 6 alone), and the exponent of an adopted load severity."""

    model: Mapping[str, Any] = field(default_factory=lambda: BASELINE)
    course: Course | None = None
    severity_exponent: float | None = None


def adopted_of(connection: Connection, clutch_id: str) -> Adopted:
    """The adopted model of a clutch's present life."""
    from service.workflows.adopt_model import present_model  # it needs the history, which needs what stands above

    return present_model(connection, clutch_id)
