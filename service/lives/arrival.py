"""A run on its arrival in a clutch's history: its event, its mean COFs, what it changes, and the warnings that it brings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from models.diagnosis.campaign import StationaryRun
from service.lives.campaign import tested
from service.lives.history import (
    DYNAMIC,
    REBUILD,
    STATIONARY,
    ByPressure,
    Event,
    Life,
    duty_block,
    life_with,
    moment_of,
    nearest,
    reference_velocities,
    stationary_test_of,
)
from service.lives.incoming_run import IncomingRun
from service.lives.model_correction import RunReader
from service.lives.receipt import bar
from service.lives.recomputation import ClutchState
from service.lives.run_analysis import LATE, OTHER_PRESSURES, Analysis, LevelFit, Notice, loops_of, mean_cofs


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """A run by itself: as it came in, whether it is a sampled record, its own results, and when it was received."""

    run: IncomingRun
    sampled: bool
    analysis: Analysis
    received_at: str


def event_of(arrival: Arrival) -> Event:
    run = arrival.run
    duty = run.details.get("duty") or {}
    names = ("cycles", "energy_per_cycle_kj", "initial_speed_rpm", "engagement_duration_s")
    maintenance = run.details.get("event")
    return Event(
        run_id=run.run_id,
        kind=run.kind,
        cycles=run.cycles,
        moment=moment_of(run.started_at, arrival.received_at),
        speed_range=arrival.analysis.speed_range,
        rebuild=maintenance == REBUILD,
        shift=maintenance not in (None, REBUILD),
        duty=duty_block(run.cycles, *(duty.get(name) for name in names)),
    )


def cofs_of(life: Life, arrival: Arrival, state: ClutchState) -> ByPressure:
    """The run's mean COFs over the protocol of its life's first stationary test, which may be itself."""
    if life.speed_range is None:
        return {}
    return mean_cofs(arrival.analysis.fits, reference_velocities(life.speed_range, state.geometry), state.geometry)


def own_loops(
    state: ClutchState, event: Event, levels: Mapping[str, Sequence[LevelFit]], run: IncomingRun
) -> Sequence[Any]:
    if run.kind != DYNAMIC:
        return ()
    test = stationary_test_of(state.events, event)
    return loops_of(run.channels, state.geometry, [] if test is None else levels.get(test.run_id, []))


def has_dynamic_tests(events: Sequence[Event], test: Event) -> bool:
    """Whether any dynamic test is evaluated against this stationary test."""
    of_tests = (stationary_test_of(events, event) for event in events if event.kind == DYNAMIC)
    return any(stationary is not None and stationary.run_id == test.run_id for stationary in of_tests)


def changes_the_past(before: ClutchState, ordered: Sequence[Event], event: Event) -> bool:
    """Whether predictions of earlier or later tests no longer hold.

    A late test or rebuild may make another test the reference, and with it the protocol of all means; under an adopted
    model any late run may bear on the corrections of those after it, and a rebuild ends the model.
    """
    late = event is not ordered[-1]
    if before.adoption is not None and (late or event.rebuild):
        return True
    return late and (event.rebuild or event.speed_range is not None)


def test_of(arrival: Arrival, life: Life) -> StationaryRun | None:
    """The run as a stationary test of a life, by the plateaus that were cut already."""
    plateaus = arrival.analysis.plateaus
    if plateaus is None:
        return None
    return tested(arrival.run, plateaus, arrival.analysis.times, origin=life.origin)


def tests_with(reader: RunReader, life: Life, arrival: Arrival) -> Iterator[StationaryRun]:
    """The stationary tests of a life in order, the run that comes in among them."""
    for event in life.events:
        if event.run_id != arrival.run.run_id:
            yield from reader.stationary_tests(replace(life, events=(event,)))
        elif event.kind == STATIONARY:
            test = test_of(arrival, life)
            if test is not None:
                yield test


def reader_with(stored: RunReader, arrival: Arrival) -> RunReader:
    """The stored runs, and the one that comes in."""
    name = arrival.run.run_id
    return RunReader(
        read=lambda run_id: arrival.run if run_id == name else stored.read(run_id),
        describe=lambda run_id: arrival.run if run_id == name else stored.describe(run_id),
        sampled=stored.sampled | ({name} if arrival.sampled else frozenset()),
    )


def other_pressures(events: Sequence[Event], new: Event) -> list[Notice]:
    """A test none of whose pressures the reference test had cannot be compared with it."""
    life = life_with(events, new)
    if not new.cofs or any(nearest(level, new.cofs) is not None for level in life.reference):
        return []
    measured = ", ".join(f"{bar(level):g}" for level in sorted(life.reference))
    message = f"none of its pressures is one of the first stationary test's ({measured} bar): no track uses it"
    return [Notice(code=OTHER_PRESSURES, message=message)]


def late_arrival(before: Sequence[Event], new: Event) -> list[Notice]:
    latest = max((event.cycles for event in before), default=0.0)
    if new.cycles >= latest:
        return []
    message = f"the run's {new.cycles:g} cycles lie before the latest known {latest:g}: all was tracked anew"
    return [Notice(code=LATE, message=message)]
