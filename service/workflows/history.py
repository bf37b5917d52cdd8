"""A clutch's history as series over duty cycles, ready to be tracked.

Runs may have arrived in any order; the history is ordered by cycles, and at equal cycles by when the runs were started
(or received, where the rig did not say). A rebuild starts a new life: cycles count from it, and the first stationary test
after it is the new reference.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from models.arrays import FloatArray
from models.clutch import Geometry
from models.protocol import protocol_speeds
from models.runs import LEVEL_GAP, LEVEL_GAP_SHARE
from models.tracking.measurement import Measurement
from service.workflows.analysis import Value

MEAN_COF = "mean_cof"
#: The mean over the reference pressures stands under this pressure.
ALL_PRESSURES = 0.0

ByPressure = Mapping[float, Value]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A run as the history sees it.

    `moment` is when it was made [s]. A stationary test has the range of its speeds [rad/s], and mean COF with its
    deviation by pressure [Pa] where its curves can say it.
    """

    run_id: str
    kind: str
    cycles: float
    moment: float
    speed_range: Value | None = None
    cofs: ByPressure = field(default_factory=dict)
    rebuild: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One quantity at one pressure: measurements by cycles since the life's origin, and which event each came from."""

    quantity: str
    pressure: float
    measurements: tuple[Measurement, ...]
    events: tuple[int, ...]

    def until(self, event: int) -> int:
        """How many measurements were there when `event` had happened."""
        return sum(1 for index in self.events if index <= event)


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """One life of a clutch: its events by cycles, and the cycles at which it began."""

    origin: float
    events: tuple[Event, ...]

    @property
    def speed_range(self) -> Value | None:
        """That of the first stationary test: it sets the protocol over which means are taken."""
        return next((event.speed_range for event in self.events if event.speed_range is not None), None)

    @property
    def reference(self) -> ByPressure:
        """Mean COF by pressure of the first stationary test that says one."""
        return next((event.cofs for event in self.events if event.cofs), {})

    def pooled(self) -> Series:
        """Mean COF over the pressures of the reference test."""
        reference = self.reference
        return self.series(MEAN_COF, ALL_PRESSURES, [_pooled(reference, event.cofs) for event in self.events])

    def at(self, level: float) -> Series:
        """Mean COF at one pressure level of the reference test."""
        return self.series(MEAN_COF, level, [nearest(level, event.cofs) for event in self.events])

    def series(self, quantity: str, pressure: float, values: Sequence[Value | None]) -> Series:
        """The series of a quantity from its value at every event, None where it has none."""
        kept = [(index, value) for index, value in enumerate(values) if value is not None]
        return Series(
            quantity=quantity,
            pressure=pressure,
            measurements=tuple(
                Measurement(progress=self.events[index].cycles - self.origin, value=value[0], variance=value[1] ** 2)
                for index, value in kept
            ),
            events=tuple(index for index, _ in kept),
        )


def order(events: Sequence[Event]) -> list[Event]:
    """By cycles, at equal cycles by when they were made: whatever the order of arrival, the history is the same."""
    return sorted(events, key=lambda event: (event.cycles, event.moment, event.run_id))


def lives(events: Sequence[Event]) -> list[Life]:
    """Cut an ordered history into lives at its rebuilds."""
    starts = [index for index, event in enumerate(events) if event.rebuild and index > 0]
    parts = [tuple(events[a:b]) for a, b in itertools.pairwise([0, *starts, len(events)]) if b > a]
    return [Life(origin=part[0].cycles if part[0].rebuild else 0.0, events=part) for part in parts]


def reference_velocities(speed_range: Value, geometry: Geometry) -> FloatArray:
    """The protocol's velocities [40] m/s for a test with that range of speeds [rad/s]."""
    return geometry.sliding_velocity(protocol_speeds(*speed_range))


def nearest(level: float, values: ByPressure) -> Value | None:
    """The value at the pressure that is the same level as `level`, if there is one."""
    if not values:
        return None
    near = min(values, key=lambda pressure: abs(pressure - level))
    return values[near] if abs(near - level) <= max(LEVEL_GAP, LEVEL_GAP_SHARE * level) else None


def _pooled(reference: ByPressure, values: ByPressure) -> Value | None:
    """Mean over the reference pressures; for a pressure that is missing the rest stands, scaled as in the reference."""
    if values.keys() == reference.keys():
        matched = dict(values)
    else:
        matched = {level: value for level in reference if (value := nearest(level, values)) is not None}
    if not matched:
        return None
    scale = _mean(reference, reference) / _mean(reference, matched)
    mean = _mean(matched, matched) * scale
    deviation = math.hypot(*(sd for _, sd in matched.values())) / len(matched) * scale
    return mean, deviation


def _mean(values: ByPressure, levels: ByPressure) -> float:
    return math.fsum(values[level][0] for level in levels) / len(levels)
