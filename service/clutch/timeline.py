"""A clutch's history as series over duty cycles, for the filters.

Runs may have arrived in any order; the history is ordered by cycles (see `order`). A rebuild starts a new life: cycles
count from it, and the first stationary test after it is the new reference. Any other maintenance begins an epoch: it may
have shifted the level of what is measured.
"""

import bisect
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import Any, TypedDict, cast

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.degradation.severity import Block
from models.friction.speed_protocol import protocol_speeds
from models.plausibility.dates import believed_dates
from models.records.criteria import LEVEL_GAP, LEVEL_GAP_SHARE
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior
from service.api.run import EndReason
from service.channels import RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS, bar
from service.clutch.analysis import Value
from service.clutch.assumptions import ALL_PRESSURES, MEAN_COF, Assumptions, Scale
from service.clutch.criteria import CLOCKS_APART, EARLIEST, LEVELS_APART, OTHER_OIL
from service.errors import LifeEndedError

ByPressure = Mapping[float, Value]
#: Pressure [Pa] -> mean COF as the model in force corrects it, its deviation, and mean COF under each of the model's draws.
Corrected = Mapping[float, tuple[float, float, tuple[float, ...]]]

#: Kinds of runs.
STATIONARY, DYNAMIC, MAINTENANCE = "stationary_stribeck", "dynamic_stribeck", "maintenance"
REBUILD, END_OF_LIFE, SENSOR_ZERO = "rebuild", "end_of_life", "sensor_zero"
#: Why a life was declared ended: it is worn, or it was taken out before its end, which is later then.
WORN = "worn"
#: The first and the last moment that have a date [s since 1970].
_MOMENTS = tuple(moment.replace(tzinfo=UTC).timestamp() for moment in (datetime.min, datetime(9999, 12, 31)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """Friction shown by a run's rows: mean COF over the speeds [-], of either sign, highest pressure [Pa] and speed
    [rad/s], median oil temperature [K]; for an open clutch the median torque [Nm]. None: not shown."""

    cof: float | None = None
    pressure: float | None = None
    speed: float | None = None
    oil: float | None = None
    open_torque: float | None = None

    def to_list(self) -> list[float | None]:
        """The numbers in the order of the fields."""
        return list(astuple(self))

    @classmethod
    def from_list(cls, numbers: Sequence[float | None]) -> "Shown":
        """The inverse of `to_list`."""
        return cls(**{field.name: number for field, number in zip(fields(cls), numbers, strict=True)})


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A run as the history sees it.

    `moment` is when it was made [s], `dated` whether the rig said so, `arrived` its place in the order of arrival,
    infinite while it comes in. A stationary test has the range of its speeds [rad/s], the mean and the range of its
    oil's temperature [K], and mean COF with its deviation by pressure [Pa] where its curves determine it, and `under`
    each draw of the model in force where that corrects it; `duty` is the block that ends with the run, `shift` an
    event that may have shifted the level, of the readings alone where it `zeroes_sensor`, `end` why the life was
    declared ended with it; `shown` what its rows show (None: a channel is dead, so that no other run bears on whether
    it is held), `confirmed` whether somebody confirmed it.
    """

    run_id: str
    kind: str
    cycles: float
    moment: float
    arrived: float = math.inf
    speed_range: Value | None = None
    oil_temperature: float | None = None
    oil_range: Value | None = None
    cofs: ByPressure = field(default_factory=dict)
    rebuild: bool = False
    shift: bool = False
    zeroes_sensor: bool = False
    end: EndReason | None = None
    duty: Block | None = None
    dated: bool = False
    shown: Shown | None = None
    confirmed: bool = False
    new_level: bool = False
    under: Mapping[float, tuple[float, ...]] = field(default_factory=dict)
    _pooled: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)
    _measured: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)

    def measured(
        self, progress: float, value: float, sd: float, epoch: int, new_levels: int, sensor: int
    ) -> Measurement:
        """A measurement of mean COF over the pressures with these numbers; the last few are cached."""
        numbers = (progress, value, sd, epoch, new_levels, sensor)
        if not self._measured or self._measured[0] != numbers:
            measurement = Measurement(
                progress=progress,
                value=value,
                variance=sd**2,
                epoch=epoch,
                new_levels=new_levels,
                sensor=sensor,
            )
            self._measured[:] = [numbers, measurement]
        made: Measurement = self._measured[1]
        return made

    def pooled(self, reference: ByPressure) -> Value | None:
        """`pooled_value` of the event's mean COFs, cached for the last reference."""
        if not self._pooled or self._pooled[0] is not reference:
            self._pooled[:] = [reference, pooled_value(reference, self.cofs)]
        value: Value | None = self._pooled[1]
        return value

    def corrected(self, cofs: Corrected | None) -> "Event":
        """The event with mean COF as corrected by the model in force; unchanged if there is no correction."""
        if cofs is None:
            return self
        means = {level: (mean, sd) for level, (mean, sd, _) in cofs.items()}
        return replace(self, cofs=means, under={level: draws for level, (_, _, draws) in cofs.items() if draws})

    def cofs_under(self, draw: int) -> ByPressure:
        """Mean COF with its standard deviation by pressure [Pa], under one draw of the model in force."""
        if not self.under:
            return self.cofs
        return {level: (self.under[level][draw], sd) for level, (_, sd) in self.cofs.items()}

    def at(self, cycles: float) -> "Event":
        """The event moved to other cycles since new."""
        return replace(self, cycles=cycles, duty=None if self.duty is None else replace(self.duty, end=cycles))


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One quantity at one pressure: measurements by progress ζ, and which event each came from.

    `scale` leads from cycles since new to ζ and back; the course of the model in force is off the measurements. A slope is
    one at `speed_rpm`, the lag of a loop one at `frequency_hz`. `draws` are the measurements under each draw of the model
    in force, by weight, where it has any: the clutch is tracked under each, and `measurements` are their mean. `new_levels`
    are the cycles since new of its tests that begin one without an event.
    """

    quantity: str
    pressure: float
    measurements: tuple[Measurement, ...]
    events: tuple[int, ...]
    scale: Scale
    assumptions: Assumptions
    speed_rpm: float | None = None
    frequency_hz: float | None = None
    draws: tuple[tuple[float, tuple[Measurement, ...]], ...] = ()
    new_levels: tuple[float, ...] = ()

    @property
    def weighted(self) -> tuple[tuple[float, tuple[Measurement, ...]], ...]:
        """The measurements under each draw, with the draw's weight; without draws, the plain measurements with weight
        1."""
        return self.draws or ((1.0, self.measurements),)

    def until(self, event: int) -> int:
        """The number of measurements up to and including `event`."""
        return sum(1 for index in self.events if index <= event)

    def priors(self, first: Measurement) -> Mapping[str, TrackPrior]:
        """The priors for tracking the series by name, given its `first` measurement."""
        return self.assumptions.priors(self.quantity, first, self.scale)

    def as_measured(self, index: int) -> tuple[float, Value]:
        """A measurement as cycles since new, value and standard deviation; the course of the model in force is added
        back."""
        measurement = self.measurements[index]
        cycles = float(self.scale.cycles(measurement.progress))
        added = float(self.assumptions.offset(self.quantity, self.pressure, np.array([cycles]))[0])
        return cycles, (measurement.value + added, measurement.variance**0.5)


@dataclass(frozen=True, kw_only=True)
class Life:
    """One life of a clutch: its events by cycles, and the cycles at which it began. Derived values are computed once."""

    origin: float
    events: tuple[Event, ...]

    @property
    def name(self) -> str:
        """The run_id of the rebuild that began it, "" where there was none."""
        return self.events[0].run_id if self.events[0].rebuild else ""

    @cached_property
    def end(self) -> Event | None:
        """The event that declares the life ended; None while it goes on."""
        return next((event for event in self.events if event.end is not None), None)

    @cached_property
    def speed_range(self) -> Value | None:
        """The speed range of the first stationary test, over which mean COFs are taken."""
        return next((event.speed_range for event in self.events if event.speed_range is not None), None)

    @cached_property
    def reference(self) -> ByPressure:
        """Mean COF by pressure of the first stationary test that has one."""
        return next((event.cofs for event in self.events if event.cofs), {})

    @cached_property
    def reference_oil(self) -> float | None:
        """Mean oil temperature [K] of the reference test; None if it was not measured."""
        return next((event.oil_temperature for event in self.events if event.cofs), None)

    @cached_property
    def tests(self) -> int:
        """The number of tests with a mean COF, including those not comparable with the first."""
        return sum(bool(event.cofs) for event in self.events)

    def in_other_oil(self, event: Event) -> bool:
        """Whether a test's oil temperature differs too much from the reference test's for a comparison."""
        reference = self.reference_oil
        if reference is None or event.oil_temperature is None:
            return False
        return abs(event.oil_temperature - reference) > OTHER_OIL

    @property
    def oil_question(self) -> str | None:
        """A clause on the oil of the last test, where its temperature moved so far within it that its curves mix
        temperatures."""
        last = next((event for event in reversed(self.events) if event.speed_range is not None), None)
        low, high = (last and last.oil_range) or (0.0, 0.0)
        if last is None or high - low <= OTHER_OIL:
            return None
        went = f"the oil went from {low - ZERO_CELSIUS:.0f} to {high - ZERO_CELSIUS:.0f} °C"
        return f"{went} within the test at {last.cycles:,.0f} cycles"

    def rig_question(self, new_levels: Sequence[float]) -> str | None:
        """A clause naming a change that the rig would explain as well as the clutch; None if there is none. It is a
        step at the cycles `new_levels` that no event explains, or mean COFs whose ratios between pressures differ from
        those of the reference test."""
        if new_levels:
            return f"mean COF stepped at {new_levels[-1]:,.0f} cycles and no maintenance was sent"
        last = next((event.cofs for event in reversed(self.events) if event.cofs), {})
        matched = {level: (cof[0], nearest(level, last)) for level, cof in self.reference.items()}
        over = {level: now[0] / new for level, (new, now) in matched.items() if now is not None}
        if not over or min(over.values()) <= 0.0 or max(over.values()) / min(over.values()) < 1.0 + LEVELS_APART:
            return None
        high, low = (bar(pick(over, key=over.__getitem__)) for pick in (max, min))
        return f"mean COF at {high:g} bar has risen against that at {low:g} bar"

    def _unexplained(self, tests: Sequence[Event]) -> Iterator[float]:
        """The cycles of tests that begin a new level with no event between them and the previous test."""
        shifts = [event.cycles for event in self.events if event.shift]
        for at in (test.cycles for test in tests if test.new_level):
            before = max((test.cycles for test in tests if test.cycles < at), default=0.0)
            if not any(before <= shift <= at for shift in shifts):
                yield at

    def until(self, event: int) -> "Life":
        """The life up to and including `event`."""
        return Life(origin=self.origin, events=self.events[: event + 1])

    def with_cofs(self, cofs: Mapping[str, ByPressure]) -> "Life":
        """The life with its tests' mean COFs replaced, by run_id; a test not among them has none."""
        return replace(
            self, events=tuple(replace(event, cofs=cofs.get(event.run_id, {}), under={}) for event in self.events)
        )

    def corrected(self, cofs: Mapping[str, Corrected]) -> "Life":
        """The life with mean COFs as corrected by a model, by run_id; other tests are unchanged."""
        return replace(self, events=tuple(event.corrected(cofs.get(event.run_id)) for event in self.events))

    def scale(self, assumptions: Assumptions) -> Scale:
        """The scale between cycles since new and ζ, from the duty of this life."""
        return assumptions.scale(self.origin, [event.duty for event in self.events if event.duty is not None])

    @cached_property
    def _pooled(self) -> list[Series]:
        """The cache of `pooled`: its last result."""
        return []

    def pooled(self, assumptions: Assumptions) -> Series:
        """Mean COF over the pressures of the reference test."""
        if not self._pooled or self._pooled[0].assumptions is not assumptions:
            self._pooled[:] = [self._mean_cofs(assumptions, ALL_PRESSURES, pooled_value, Event.pooled)]
        return self._pooled[0]

    def at(self, assumptions: Assumptions, level: float) -> Series:
        """Mean COF at one pressure level of the reference test."""
        return self._mean_cofs(
            assumptions, level, lambda _, cofs: nearest(level, cofs), lambda event, _: nearest(level, event.cofs)
        )

    def _mean_cofs(
        self,
        assumptions: Assumptions,
        level: float,
        value: Callable[[ByPressure, ByPressure], Value | None],
        value_of: Callable[[Event, ByPressure], Value | None],
    ) -> Series:
        """The series of mean COF computed by `value` from the reference test's and a test's mean COFs, under each draw
        of the model in force."""
        first = next((event for event in self.events if event.cofs), None)
        reference = {} if first is None else first.cofs
        values = [value_of(event, reference) for event in self.events]
        series = self.series(assumptions, MEAN_COF, level, values)
        weights, course = assumptions.model.weights, assumptions.model.course
        if first is None or len(weights) == 1 or (course is None and not any(event.under for event in self.events)):
            return series
        cycles = np.array([self.events[index].cycles for index in series.events])
        off = assumptions.offsets(MEAN_COF, level, cycles)
        draws = []
        for draw, weight in enumerate(weights):
            own_reference = first.cofs_under(draw)
            cofs = [value(own_reference, self.events[index].cofs_under(draw)) for index in series.events]
            offsets = off[min(draw, len(off) - 1)].tolist()
            measurements = tuple(
                replace(measured, value=cof[0] - added)
                for measured, cof, added in zip(series.measurements, cofs, offsets, strict=True)
                if cof is not None
            )
            draws.append((weight, measurements))
        return replace(series, draws=tuple(draws))

    def series(
        self, assumptions: Assumptions, quantity: str, pressure: float, values: Sequence[Value | None]
    ) -> Series:
        """The series of a quantity from its value at every event (None: no value).

        Tests in oil of another temperature are left out, unless the model in force corrects for it.
        """
        corrected = assumptions.corrects_oil(quantity)
        measured = [
            (index, value)
            for index, (event, value) in enumerate(zip(self.events, values, strict=True))
            if value is not None and (corrected or not self.in_other_oil(event))
        ]
        scale = self.scale(assumptions)
        cycles = np.array([self.events[index].cycles for index, _ in measured])
        course = assumptions.offset(quantity, pressure, cycles)
        epochs = list(itertools.accumulate(int(event.shift or event.new_level) for event in self.events))
        levels = list(itertools.accumulate(int(event.new_level) for event in self.events))
        zeroed = list(itertools.accumulate(int(event.zeroes_sensor) for event in self.events))
        places = zip(measured, scale.progress(cycles).tolist(), course.tolist(), strict=True)
        return Series(
            quantity=quantity,
            pressure=pressure,
            measurements=tuple(
                self.events[index].measured(at, value - off, sd, epochs[index], levels[index], zeroed[index])
                if pressure == ALL_PRESSURES
                else Measurement(
                    progress=at,
                    value=value - off,
                    variance=sd**2,
                    epoch=epochs[index],
                    new_levels=levels[index],
                    sensor=zeroed[index],
                )
                for (index, (value, sd)), at, off in places
            ),
            events=tuple(index for index, _ in measured),
            scale=scale,
            assumptions=assumptions,
            new_levels=tuple(self._unexplained([self.events[index] for index, _ in measured])),
        )


def order(events: Sequence[Event]) -> tuple[Event, ...]:
    """Events sorted by cycles, and at equal cycles by the time they were made, irrespective of the order of arrival.

    A run without a stated time counts as no earlier than the runs that arrived before it.
    """
    arrived = sorted((event for event in events if not event.dated), key=lambda event: event.arrived)
    moments = itertools.accumulate((event.moment for event in arrived), max)
    places = {event.run_id: (moment, place) for place, (event, moment) in enumerate(zip(arrived, moments, strict=True))}
    return tuple(
        sorted(events, key=lambda event: (event.cycles, *places.get(event.run_id, (event.moment, 0)), event.run_id))
    )


def with_event(events: tuple[Event, ...], event: Event) -> tuple[Event, ...]:
    """The history with one more event, in order."""
    if not events or event.cycles > events[-1].cycles:  # behind all others, whatever is known of dates
        return (*events, event)
    return order([*events, event])


def lives_of(events: Sequence[Event]) -> list[Life]:
    """The lives of an ordered history, separated by its rebuilds."""
    starts = [index for index, event in enumerate(events) if event.rebuild and index > 0]
    parts = [tuple(events[a:b]) for a, b in itertools.pairwise([0, *starts, len(events)]) if b > a]
    return [Life(origin=part[0].cycles if part[0].rebuild else 0.0, events=part) for part in parts]


class MaintenanceFields(TypedDict):
    """The fields of an event that describe maintenance."""

    rebuild: bool
    shift: bool
    zeroes_sensor: bool
    end: EndReason | None


def maintenance_fields(event: str | None, reason: str | None) -> MaintenanceFields:
    """The fields of an event for maintenance of that kind; all false or None for other runs."""
    return {
        "rebuild": event == REBUILD,
        "shift": event not in (None, REBUILD, END_OF_LIFE),
        "zeroes_sensor": event == SENSOR_ZERO,
        "end": cast("EndReason | None", reason) if event == END_OF_LIFE else None,
    }


def lives_until(lives: Sequence[Life], cycles: float | None) -> Sequence[Life]:
    """The lives as of this many cycles since new; None: in full."""
    if cycles is None:
        return lives
    happened = ((life, tuple(event for event in life.events if event.cycles <= cycles)) for life in lives)
    return [Life(origin=life.origin, events=events) for life, events in happened if events]


def require_within_ends(lives: Sequence[Life]) -> None:
    """Raise LifeEndedError if a life has duty, tests or a second end after its declared end."""
    beyond = beyond_end(lives)
    if beyond is not None:
        end, event = beyond
        later = "a second end" if event.end else f"{event.kind} {event.run_id!r}"
        raise LifeEndedError(
            f"{later} at {event.cycles:g} cycles is after the declared end at {end.cycles:g} cycles (run {end.run_id!r}): "
            f"declare the end at {event.cycles:g} cycles or later, post a rebuild, correct the cycles, or withdraw the end"
        )


def beyond_end(lives: Sequence[Life]) -> tuple[Event, Event] | None:
    """The first declared end of a life that is followed by duty, a test or a second end, with that event; None if there
    is none."""
    for life in lives:
        end = life.end
        if end is None:
            continue
        for event in life.events:
            second = event.end is not None and event is not end
            if second or (event.kind != MAINTENANCE and event.cycles > end.cycles):
                return end, event
    return None


def stationary_tests_of(lives: Sequence[Life]) -> dict[str, str | None]:
    """run_id of each dynamic test -> run_id of the stationary test that shows the clutch's state then: the last of its
    life up to its cycles, else the next; None if there is none."""
    names: dict[str, str | None] = {}
    for life in lives:
        tests = [event for event in life.events if event.speed_range is not None]
        cycles = [test.cycles for test in tests]
        for event in life.events:
            if event.kind == DYNAMIC:
                place = max(0, bisect.bisect_right(cycles, event.cycles) - 1)
                names[event.run_id] = tests[place].run_id if tests else None
    return names


def latest_before(events: Sequence[Event]) -> dict[str, float]:
    """run_id -> the most cycles of all runs that arrived before it, 0 for the first."""
    latest, most = {}, 0.0
    for event in sorted(events, key=lambda event: event.arrived):
        latest[event.run_id] = most
        most = max(most, event.cycles)
    return latest


def reference_velocities(speed_range: Value, geometry: Geometry) -> FloatArray:
    """The protocol's velocities [40] m/s for a test with that range of speeds [rad/s]."""
    return geometry.sliding_velocity(protocol_speeds(*speed_range))


def nearest(level: float, values: ByPressure) -> Value | None:
    """The value at the pressure of the same level as `level`; None if there is none."""
    if level in values or not values:
        return values.get(level)
    near = min(values, key=lambda pressure: abs(pressure - level))
    return values[near] if abs(near - level) <= max(LEVEL_GAP, LEVEL_GAP_SHARE * level) else None


def nearest_pressure(level: float, pressures: Sequence[float]) -> float | None:
    """The pressure [Pa] of the same level as `level`; None if there is none."""
    near = nearest(level, {pressure: (pressure, 0.0) for pressure in pressures})
    return None if near is None else near[0]


def duty_block(
    end: float, cycles: float | None, energy_kj: float | None, speed_rpm: float | None, duration_s: float | None
) -> Block | None:
    """The block of duty of a run in SI units; None if the run is no duty."""
    if cycles is None:
        return None
    return Block(
        end=end,
        cycles=cycles,
        energy=None if energy_kj is None else 1000.0 * energy_kj,
        speed=None if speed_rpm is None else speed_rpm * RADIANS_PER_SECOND_PER_RPM,
        duration=duration_s,
    )


def moment_of(started_at: str | None, received_at: str) -> tuple[float, bool]:
    """The time of a run [s since 1970], and whether the rig stated it: the start, or the receipt if the rig stated none
    or an impossible one."""
    received = datetime.fromisoformat(received_at).timestamp()
    if started_at is None or not is_possible(started_at, received_at):
        return received, False
    return datetime.fromisoformat(started_at).timestamp(), True


def is_possible(started_at: str, received_at: str) -> bool:
    """Whether a start time is possible for a run received then: not before EARLIEST, and at most CLOCKS_APART after the
    receipt."""
    started, received = (datetime.fromisoformat(each) for each in (started_at, received_at))
    return started.timestamp() >= EARLIEST and started.timestamp() <= received.timestamp() + CLOCKS_APART


def with_believed_dates(events: Sequence[Event]) -> list[Event]:
    """The dated runs of a life, ordered, whose dates fit each other in the order of their cycles."""
    dated = [event for event in events if event.dated]
    starts = [event.cycles if event.duty is None else max(event.cycles - event.duty.cycles, 0.0) for event in dated]
    return [dated[index] for index in sorted(believed_dates(starts, [event.moment for event in dated]))]


def pace_of(events: Sequence[Event]) -> float | None:
    """Cycles a second between the first and the last run of a life whose dates are believed, idle hours included; None where
    none is known."""
    dated = with_believed_dates(events)
    if len(dated) < 2:
        return None
    seconds, cycles = dated[-1].moment - dated[0].moment, dated[-1].cycles - dated[0].cycles
    return cycles / seconds if seconds > 0.0 and cycles > 0.0 else None


def moment_at(events: Sequence[Event], pace: float, cycles: float) -> float:
    """When [s since 1970] so many cycles since new will have been run at a pace [1/s], from the newest run of a life
    on whose date is believed, or from its newest where none is. There is at least one run."""
    start = (with_believed_dates(events) or events)[-1]
    return start.moment + (cycles - start.cycles) / pace


def date_of(moment: float) -> str | None:
    """A time [s since 1970] as ISO 8601 text in UTC; None outside of the years 1 to 9999."""
    earliest, latest = _MOMENTS
    return datetime.fromtimestamp(moment, UTC).isoformat(timespec="seconds") if earliest < moment < latest else None


def pooled_value(reference: ByPressure, values: ByPressure) -> Value | None:
    """The mean over the reference pressures; a missing pressure is replaced by the others, scaled as in the reference."""
    if values.keys() == reference.keys():
        matched, scale = values, 1.0
    else:
        matched = {level: value for level in reference if (value := nearest(level, values)) is not None}
        scale = _mean(reference, reference) / _mean(reference, matched) if matched else 1.0
    if not matched:
        return None
    means, deviations = zip(*matched.values(), strict=True)
    return math.fsum(means) / len(means) * scale, math.hypot(*deviations) / len(means) * scale


def _mean(values: ByPressure, levels: ByPressure) -> float:
    return math.fsum(values[level][0] for level in levels) / len(levels)
