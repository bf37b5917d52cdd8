"""A clutch's history as series over duty cycles, ready to be tracked.

Runs may have arrived in any order; the history is ordered by cycles, and at equal cycles by when the runs were started
(or received, where the rig did not say). A rebuild starts a new life: cycles count from it, and the first stationary test
after it is the new reference. Any other maintenance begins an epoch: it may have shifted the level of what is measured.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.degradation.severity import Block
from models.friction.speed_protocol import protocol_speeds
from models.records.criteria import LEVEL_GAP, LEVEL_GAP_SHARE
from models.tracking.measurement import Measurement
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, Basis, Scale
from service.lives.run_analysis import Value

ByPressure = Mapping[float, Value]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A run as the history sees it.

    `moment` is when it was made [s]. A stationary test has the range of its speeds [rad/s], and mean COF with its
    deviation by pressure [Pa] where its curves can say it; `duty` is the block that ends with the run, `shift` an event
    that may have shifted the level.
    """

    run_id: str
    kind: str
    cycles: float
    moment: float
    speed_range: Value | None = None
    cofs: ByPressure = field(default_factory=dict)
    rebuild: bool = False
    shift: bool = False
    duty: Block | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One quantity at one pressure: measurements by progress ζ, and which event each came from.

    `scale` leads from cycles since new to ζ and back; an adopted model's course is off the measurements.
    """

    quantity: str
    pressure: float
    measurements: tuple[Measurement, ...]
    events: tuple[int, ...]
    scale: Scale

    def until(self, event: int) -> int:
        """How many measurements were there when `event` had happened."""
        return sum(1 for index in self.events if index <= event)


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """One life of a clutch: its events by cycles, and the cycles at which it began."""

    origin: float
    events: tuple[Event, ...]

    @property
    def name(self) -> str:
        """The run_id of the rebuild that began it, "" where there was none."""
        return self.events[0].run_id if self.events[0].rebuild else ""

    @property
    def speed_range(self) -> Value | None:
        """That of the first stationary test: it sets the protocol over which means are taken."""
        return next((event.speed_range for event in self.events if event.speed_range is not None), None)

    @property
    def reference(self) -> ByPressure:
        """Mean COF by pressure of the first stationary test that says one."""
        return next((event.cofs for event in self.events if event.cofs), {})

    def until(self, event: int) -> "Life":
        """The life as it was when `event` had happened."""
        return Life(origin=self.origin, events=self.events[: event + 1])

    def scale(self, basis: Basis) -> Scale:
        """ζ over cycles since new, by the duty of this life."""
        return basis.scale(self.origin, [event.duty for event in self.events if event.duty is not None])

    def pooled(self, basis: Basis) -> Series:
        """Mean COF over the pressures of the reference test."""
        reference = self.reference
        return self.series(basis, MEAN_COF, ALL_PRESSURES, [_pooled(reference, event.cofs) for event in self.events])

    def at(self, basis: Basis, level: float) -> Series:
        """Mean COF at one pressure level of the reference test."""
        return self.series(basis, MEAN_COF, level, [nearest(level, event.cofs) for event in self.events])

    def series(self, basis: Basis, quantity: str, pressure: float, values: Sequence[Value | None]) -> Series:
        """The series of a quantity from its value at every event, None where it has none."""
        kept = [(index, value) for index, value in enumerate(values) if value is not None]
        scale = self.scale(basis)
        cycles = np.array([self.events[index].cycles for index, _ in kept])
        course = basis.offset(quantity, pressure, cycles)
        epochs = list(itertools.accumulate(int(event.shift) for event in self.events))
        return Series(
            quantity=quantity,
            pressure=pressure,
            measurements=tuple(
                Measurement(progress=zeta, value=value - off, variance=sd**2, epoch=epochs[index])
                for (index, (value, sd)), zeta, off in zip(
                    kept, scale.progress(cycles).tolist(), course.tolist(), strict=True
                )
            ),
            events=tuple(index for index, _ in kept),
            scale=scale,
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
