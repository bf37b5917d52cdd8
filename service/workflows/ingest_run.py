"""A run comes in: its curves are fitted, the clutch is tracked on or anew, and all is stored in one short transaction.

Everything is computed before the database is locked; where another run of the clutch was stored meanwhile, what depends on
the history is computed again.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection

from service import records, stored_runs
from service.columns import bar
from service.errors import ConflictError
from service.lives.history import (
    DYNAMIC,
    REBUILD,
    ByPressure,
    Event,
    Life,
    duty_block,
    life_with,
    moment_of,
    nearest,
    order,
    reference_velocities,
    stationary_test_of,
)
from service.lives.incoming_run import IncomingRun
from service.lives.late_run import Arrival, reader_with, test_of, tests_with
from service.lives.payloads import receipt
from service.lives.recomputation import ClutchState, Results, computed_anew, corrected_newest, loops_anew, track
from service.lives.run_analysis import LATE, OTHER_PRESSURES, LevelFit, Notice, analyse, loops_of, mean_cofs
from service.settings import CODE_VERSION
from storage import channels, clutches, results, runs
from storage.engine.database import Database
from storage.runs import NewRun, RunRow


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """What a run changes in a clutch at a revision: its receipt and mean COFs, and the results of what was there before."""

    revision: int
    receipt: dict[str, Any]
    cofs: ByPressure
    results: Results


def ingest(database: Database, clutch_id: str, run: IncomingRun, *, received_at: str) -> tuple[dict[str, Any], bool]:
    """Take in a run; returns its receipt and whether it is new.

    The same run again gives the same receipt, marked a duplicate. Raises NotFoundError for an unknown clutch and
    ConflictError where other content is known under the run's name; then nothing has changed.
    """
    with database.reading() as connection:
        clutch = records.clutch(connection, clutch_id)
        stored = runs.get(connection, clutch_id, run.run_id)
    if stored is not None:
        return _repeat(stored, run), False
    with ThreadPoolExecutor(1) as beside:  # deflating a long record lets its cutting run
        encoding = beside.submit(channels.encoded, run.channels)
        analysis = analyse(run, records.record(clutch).geometry.to_model())
        columns = encoding.result()
    sampled = "time_s" in run.channels
    if sampled and run.kind != DYNAMIC:  # loops are yet to be fitted; another long record need not be held twice
        run = replace(run, channels={})
    arrival = Arrival(run=run, sampled=sampled, analysis=analysis, received_at=received_at)
    with database.turn(clutch_id):
        while True:
            with database.reading() as connection:  # a repeat may have waited for its turn
                stored = runs.get(connection, clutch_id, run.run_id)
            if stored is not None:
                return _repeat(stored, run), False
            outcome = _computed(database, clutch_id, arrival)
            with database.writing() as connection:  # another process's run of the same name moves the revision
                if records.unchanged(connection, clutch_id, outcome.revision):
                    _store(connection, clutch_id, arrival, columns, outcome)
                    return outcome.receipt, True


def _repeat(stored: RunRow, run: IncomingRun) -> dict[str, Any]:
    if stored.content_sha256 != run.content_sha256:
        raise ConflictError(
            f"run_id {run.run_id!r} is known with other content: its sha256 is {stored.content_sha256}, "
            f"that of the content sent is {run.content_sha256}"
        )
    return stored.receipt | {"duplicate": True}


def _computed(database: Database, clutch_id: str, arrival: Arrival) -> _Outcome:
    """The results of the run in the clutch's history as it is now."""
    with database.reading() as connection:
        before = records.state(connection, clutch_id, carried=True)
    event = _event_of(arrival)
    life = life_with(order([*before.events, event]), event)
    event = replace(event, cofs=_cofs_of(life, arrival, before))
    state = replace(before, events=order([*before.events, event]))
    levels = _levels(database, state, event, arrival)
    warnings = [
        *arrival.analysis.warnings,
        *_late_arrival(before.events, event),
        *_other_pressures(state.events, event),
    ]
    answer = receipt(
        clutch_id,
        arrival.run,
        received_at=arrival.received_at,
        levels=arrival.analysis.fits,
        cofs=event.cofs,
        loops=_own_loops(state, event, levels, arrival.run),
        warnings=warnings,
    )
    if _changes_the_past(before, state.events, event):
        computed = _past_anew(database, state, levels, answer, arrival)
    else:
        computed = _carried_on(database, state, event, arrival)
        if (
            computed.tracking is not None
            and event is state.events[-1]
            and event.cofs
            and not _other_pressures(state.events, event)
        ):
            answer["warnings"] += computed.tracking.warnings
    if event.speed_range is not None:
        computed = _with_loops(database, state, event, levels, computed)
    others = {run_id: other for run_id, other in computed.receipts.items() if run_id != event.run_id}
    return _Outcome(
        revision=before.revision, receipt=answer, cofs=event.cofs, results=replace(computed, receipts=others)
    )


def _carried_on(database: Database, state: ClutchState, event: Event, arrival: Arrival) -> Results:
    """The filters carried one step on."""
    corrected = None
    if state.extension is not None and event is state.events[-1]:
        runs_before = stored_runs.run_reader(database, state.clutch_id)
        corrected = corrected_newest(state, event, test_of(arrival, life_with(state.events, event)), runs_before)
    if corrected is None:
        return Results(tracking=track(state, newest=event))
    newest = replace(event, cofs=corrected)
    freed = replace(state, events=(*state.events[:-1], newest))
    return Results(corrected={event.run_id: corrected}, tracking=track(freed, newest=newest))


def _past_anew(
    database: Database,
    state: ClutchState,
    levels: Mapping[str, Sequence[LevelFit]],
    answer: dict[str, Any],
    arrival: Arrival,
) -> Results:
    """Everything of the clutch computed anew, the run among the others."""
    with database.reading() as connection:
        receipts = records.receipts(connection, state.clutch_id)
    reader = reader_with(stored_runs.run_reader(database, state.clutch_id), arrival)
    tests = tests_with(reader, state.lives[-1], arrival)
    _, computed = computed_anew(state, levels, receipts | {arrival.run.run_id: answer}, tests, reader)
    return computed


def _with_loops(
    database: Database,
    state: ClutchState,
    event: Event,
    levels: Mapping[str, Sequence[LevelFit]],
    computed: Results,
) -> Results:
    """With the loops of dynamic tests whose stationary test the run has become."""
    if not _has_dynamic_tests(state.events, event):
        return computed
    loops = loops_anew(state, levels, stored_runs.run_reader(database, state.clutch_id), since=event)
    with database.reading() as connection:
        receipts = records.receipts(connection, state.clutch_id) | dict(computed.receipts)
    changed = {run_id: receipts[run_id] | {"loops": items} for run_id, items in loops.items()}
    return replace(computed, receipts={**computed.receipts, **changed})


def _levels(database: Database, state: ClutchState, event: Event, arrival: Arrival) -> Mapping[str, Sequence[LevelFit]]:
    """The levels of all tests where they are needed, else those of the run alone."""
    own = {event.run_id: arrival.analysis.fits} if arrival.analysis.fits else {}
    if event.kind != DYNAMIC and event is state.events[-1] and not event.rebuild and state.adoption is None:
        return own
    with database.reading() as connection:
        return records.levels(connection, state.clutch_id) | own


def _store(
    connection: Connection, clutch_id: str, arrival: Arrival, columns: channels.Encoded, outcome: _Outcome
) -> None:
    """The run, its channels and fits, and what it changes; the revision moves on."""
    run = arrival.run
    run_key = runs.insert(
        connection,
        NewRun(
            clutch_id=clutch_id,
            run_id=run.run_id,
            kind=run.kind,
            cycles=run.cycles,
            started_at=run.started_at,
            received_at=arrival.received_at,
            content_sha256=run.content_sha256,
            details=records.details(run, arrival.analysis),
            receipt=outcome.receipt,
            code_version=CODE_VERSION,
        ),
    )
    channels.write(connection, run_key, columns)
    results.write_fits(connection, run_key, records.fit_rows(arrival.analysis.fits, outcome.cofs))
    records.store(connection, clutch_id, outcome.results)
    clutches.bump_revision(connection, clutch_id)


def _event_of(arrival: Arrival) -> Event:
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
        dated=run.started_at is not None,
    )


def _cofs_of(life: Life, arrival: Arrival, state: ClutchState) -> ByPressure:
    """The run's mean COFs over the protocol of its life's first stationary test, which may be itself."""
    if life.speed_range is None:
        return {}
    return mean_cofs(arrival.analysis.fits, reference_velocities(life.speed_range, state.geometry), state.geometry)


def _own_loops(
    state: ClutchState, event: Event, levels: Mapping[str, Sequence[LevelFit]], run: IncomingRun
) -> Sequence[Any]:
    if run.kind != DYNAMIC:
        return ()
    test = stationary_test_of(state.events, event)
    return loops_of(run.channels, state.geometry, [] if test is None else levels.get(test.run_id, []))


def _has_dynamic_tests(events: Sequence[Event], test: Event) -> bool:
    """Whether any dynamic test is evaluated against this stationary test."""
    of_tests = (stationary_test_of(events, event) for event in events if event.kind == DYNAMIC)
    return any(stationary is not None and stationary.run_id == test.run_id for stationary in of_tests)


def _changes_the_past(before: ClutchState, ordered: Sequence[Event], event: Event) -> bool:
    """Whether predictions of earlier or later tests no longer hold.

    A late test or rebuild may make another test the reference, and with it the protocol of all means; under an adopted
    model any late run may bear on the corrections of those after it, and a rebuild ends the model.
    """
    late = event is not ordered[-1]
    if before.adoption is not None and (late or event.rebuild):
        return True
    return late and (event.rebuild or event.speed_range is not None)


def _other_pressures(events: Sequence[Event], new: Event) -> list[Notice]:
    """A test none of whose pressures the reference test had cannot be compared with it."""
    life = life_with(events, new)
    if not new.cofs or any(nearest(level, new.cofs) is not None for level in life.reference):
        return []
    measured = ", ".join(f"{bar(level):g}" for level in sorted(life.reference))
    message = f"none of its pressures is one of the first stationary test's ({measured} bar): no track uses it"
    return [Notice(code=OTHER_PRESSURES, message=message)]


def _late_arrival(before: Sequence[Event], new: Event) -> list[Notice]:
    latest = max((event.cycles for event in before), default=0.0)
    if new.cycles >= latest:
        return []
    message = f"the run's {new.cycles:g} cycles lie before the latest known {latest:g}: all was tracked anew"
    return [Notice(code=LATE, message=message)]
