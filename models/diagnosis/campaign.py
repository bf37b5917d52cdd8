"""A campaign: all runs of one life of a clutch, in SI units, in the order of their cycles.

Cycles count from the beginning of the life (new, or the last rebuild). Moments are seconds on one clock (since 1970) where
the rig sent when a run was started, else None. A stationary run is its steady plateaus in the order in which they were
made; where a raw record was sent, it is kept beside them as evidence of what happens within a dwell.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TypeVar

from models.clutch import Geometry
from models.records.runs import Plateaus, Record


class EventKind(StrEnum):
    """The kind of maintenance."""

    OIL_CHANGE = "oil_change"
    REST = "rest"
    SENSOR_ZERO = "sensor_zero"
    REBUILD = "rebuild"
    END_OF_LIFE = "end_of_life"
    OTHER = "other"


@dataclass(frozen=True, slots=True, kw_only=True)
class Oil:
    """Kinematic viscosity [m²/s] at 40 °C and at 100 °C; the defaults are the reference's ATF, 56 and 9.3 cSt.

    Raises ValueError unless viscosity_40 > viscosity_100 > 0.
    """

    viscosity_40: float = 56e-6
    viscosity_100: float = 9.3e-6

    def __post_init__(self) -> None:
        if not (math.isfinite(self.viscosity_40) and 0 < self.viscosity_100 < self.viscosity_40):
            raise ValueError(
                f"viscosities must satisfy 0 < at 100 °C < at 40 °C, got {self.viscosity_100} and {self.viscosity_40}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class StationaryRun:
    """A stationary test after `cycles` >= 0."""

    run_id: str
    cycles: float
    plateaus: Plateaus  # in the order they were made
    moment: float | None = None
    time: tuple[float, ...] | None = None  # [n] s, the middle of each plateau on the test's own clock where it is known
    record: Record | None = None  # the raw record if one was sent


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicRun:
    """A dynamic test after `cycles` >= 0: the record as it was sampled, one or several pressures."""

    run_id: str
    cycles: float
    record: Record
    moment: float | None = None


#: One of the two kinds of test, the same throughout a signature.
TestRun = TypeVar("TestRun", StationaryRun, DynamicRun)


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyRun:
    """A block of duty that ends at `cycles`; `energy` [J] is that of each engagement where the rig sent it."""

    cycles: float
    engagements: float
    energy: float | None = None
    moment: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MaintenanceEvent:
    """Maintenance of clutch or rig at `cycles`."""

    cycles: float
    event: EventKind
    moment: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """One life of a clutch, each kind of run ordered by cycles, at equal cycles by moment."""

    geometry: Geometry = field(default_factory=Geometry)
    oil: Oil = field(default_factory=Oil)
    stationary: tuple[StationaryRun, ...] = ()
    dynamic: tuple[DynamicRun, ...] = ()
    duty: tuple[DutyRun, ...] = ()
    maintenance: tuple[MaintenanceEvent, ...] = ()

    @property
    def tests(self) -> tuple[StationaryRun | DynamicRun, ...]:
        """The stationary tests, then the dynamic ones."""
        return (*self.stationary, *self.dynamic)
