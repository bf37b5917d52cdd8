"""Takes in a run: fits its curves, tracks the clutch, and stores everything in one short transaction.

Everything is computed before the database is locked; where another run of the clutch was stored meanwhile, what depends on
the history is computed again. A doubtful run is stored with its curves, held, and changes nothing else.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from sqlalchemy import Connection

from models.clutch import Geometry
from models.loops.loops import FrictionLoop
from service import repository
from service.api.run import Evaluation, Receipt
from service.clutch import timeline
from service.clutch.analysis import LevelFit, analyse, loops_of
from service.clutch.engagements import stored_engagement
from service.clutch.incoming_run import IncomingRun
from service.clutch.items import doubted, receipt
from service.clutch.notices import history_warnings, warned_again
from service.clutch.plausibility.doubts import Judged, doubts_alone, doubts_together
from service.clutch.recomputation import (
    Arrival,
    ClutchHistory,
    Levels,
    Results,
    Tracking,
    cofs_among,
    computed_again,
    corrected_newest,
    loops_again,
    reader_with,
    test_of,
    track,
    with_set_aside,
)
from service.clutch.with_held import ClutchMeasurements, held_summary, needs_evidence, summarised
from service.errors import ArchivedError, BusyError, ConflictError, Notice, TooLargeError
from service.kept_history import FOLLOWS, keep_filters
from service.settings import CODE_VERSION
from storage import changes, raw_columns, results, runs
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.raw_columns import PackedFile
from storage.runs import RunRow

#: Bytes of a packed file that are kept. Derived: a value of SQLite's has 1e9 at most.
MAX_FILE_BYTES = 900_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """The results of a run for a clutch at a revision: its receipt, mean COFs and doubts, and the changed results of
    earlier runs; `appended`: no earlier run's results changed."""

    revision: int
    receipt: Evaluation
    cofs: timeline.ByPressure
    results: Results
    doubts: tuple[Notice, ...] = ()
    appended: bool = False

    @property
    def state(self) -> str:
        return runs.HELD if self.doubts else runs.ACCEPTED


def ingest_posted(
    database: Database,
    clutch_id: str,
    read: Callable[[], IncomingRun],
    received_at: str,
    by: str,
    path: Path | None = None,
) -> tuple[Receipt, bool]:
    """Store the run that `read` returns from a request's body; a file at `path` is stored with it. Raises also the
    errors of `read`, and TooLargeError if the file is too long to be kept."""
    if path is None:
        return ingest(database, clutch_id, read(), received_at=received_at, by=by)
    with ThreadPoolExecutor(1) as deflating:  # deflating lets the reader run
        packing = deflating.submit(raw_columns.packed, path)
        run, file = read(), packing.result()
    if len(file.data) > MAX_FILE_BYTES:
        raise TooLargeError(
            f"a file must have at most {MAX_FILE_BYTES} bytes when it is compressed, got {len(file.data)}"
        )
    run = replace(run, file={**(run.file or {}), "sha256": file.sha256, "bytes": file.length})
    return ingest(database, clutch_id, run, received_at=received_at, by=by, file=file)


def ingest(
    database: Database,
    clutch_id: str,
    run: IncomingRun,
    *,
    received_at: str,
    by: str = "local",
    file: PackedFile | None = None,
) -> tuple[Receipt, bool]:
    """Store a run sent by `by`, read from `file`; returns its receipt and whether it is new. Where results of earlier
    runs are damaged they are computed again first.

    The same run again gives the receipt as it is then, marked a duplicate. Raises NotFoundError for an unknown clutch,
    ArchivedError for one that takes in no more, ConflictError where other content is known under the run's name, and
    BusyError where the clutch's geometry or filter was edited meanwhile; then nothing has changed.
    """
    try:
        return _ingested(database, clutch_id, run, received_at=received_at, by=by, file=file)
    except DamagedData as damage:
        repository.mend(database, clutch_id, damage)
        return _ingested(database, clutch_id, run, received_at=received_at, by=by, file=file)


def _ingested(
    database: Database, clutch_id: str, run: IncomingRun, *, received_at: str, by: str, file: PackedFile | None
) -> tuple[Receipt, bool]:
    """Store a run: `ingest` without its repair of damaged results."""
    with database.reading() as connection:
        clutch = repository.clutch(connection, clutch_id)
        stored = _stored(connection, clutch_id, run)
    if stored is not None:
        return _repeat(stored, run), False
    record, sampled = repository.record(clutch), "time_s" in run.channels
    geometry, torque_filter = record.geometry.to_model(), record.torque_filter
    if sampled:
        with ThreadPoolExecutor(1) as deflating:  # deflating a long record lets its cutting run
            encoding = deflating.submit(raw_columns.encoded, run.channels, file)
            analysis = analyse(run, geometry, torque_filter)
            columns = encoding.result()
    else:  # a thread takes longer to begin than a few plateaus to deflate
        analysis, columns = analyse(run, geometry, torque_filter), raw_columns.encoded(run.channels, file)
    # Loops are yet to be fitted; another long record need not be held twice.
    if sampled and run.kind == timeline.STATIONARY:
        run = replace(run, channels={})
    if columns.is_long:
        columns = repository.placed(database, columns)
    shown, odd = doubts_alone(run, analysis, geometry)
    arrival = Arrival(run=run, sampled=sampled, analysis=analysis, shown=shown, odd=odd, received_at=received_at)
    attempts = repository.attempts(clutch_id)
    while True:
        next(attempts)
        with database.reading() as connection:  # one state: the same run may come in beside this one at any moment
            stored = _stored(connection, clutch_id, run)
            if stored is not None:
                return _repeat(stored, run), False
            before = repository.state(connection, clutch_id, carried=True)
        if before.archived:
            raise ArchivedError(f"clutch {clutch_id!r} is archived and takes no more runs")
        outcome = _computed(database, before, arrival, (geometry, torque_filter))
        with database.writing(of=clutch_id) as connection:  # another process's run of the same name moves the revision
            if not repository.unchanged(connection, clutch_id, outcome.revision):
                continue
            answer, revision = _store(connection, clutch_id, arrival, columns, outcome, by=by)
        if outcome.results.tracking is not None:
            keep_filters(database, clutch_id, revision, outcome.results.tracking.filters)
        return answer, True


def _stored(connection: Connection, clutch_id: str, run: IncomingRun) -> RunRow | None:
    """The stored run with this name; for a file, also a run with the same content after it was read again."""
    stored = runs.get(connection, clutch_id, run.run_id)
    if stored is None and run.file is not None:
        return runs.read_again_as(connection, clutch_id, run.content_sha256)
    return stored


def _repeat(stored: RunRow, run: IncomingRun) -> Receipt:
    """The receipt of a run that is sent again, marked a duplicate. Raises ConflictError if its content differs."""
    if run.content_sha256 not in (stored.content_sha256, stored.details.get("file", {}).get("content_sha256")):
        raise ConflictError(
            f"run_id {run.run_id!r} is already stored with other content: the stored sha256 is {stored.content_sha256}, "
            f"the sha256 of the content sent is {run.content_sha256}"
        )
    return repository.receipt(stored).model_copy(update={"duplicate": True})


def _computed(
    database: Database, before: ClutchHistory, arrival: Arrival, read_with: tuple[Geometry, float]
) -> _Outcome:
    """The results of a run added to the clutch's history `before` it; the run was read with a geometry and a filter.

    Accepted, it is one more event. Doubted, it is held, and only the summary speaks of it. Where it speaks for or
    against other runs, these are accepted or held as well, and the whole history is computed again.
    """
    if (before.geometry, before.record.torque_filter) != read_with:
        raise BusyError("the clutch's geometry or filter was edited while the run was read: send the run again")
    event = _event_of(arrival)
    event = replace(event, cofs=cofs_among(before, event, arrival.analysis.fits))
    state = before.with_event(event)
    timeline.require_within_ends(state.lives)
    levels = _levels(database, state, event, arrival)
    answer, evaluated = _receipt(before, state, event, arrival, levels)
    judged = Judged()
    if not arrival.odd:
        corrected = before.extension is not None
        judged = doubts_together(before.events, before.held, event, before.geometry, corrected=corrected)
    doubts = arrival.odd or judged.doubts.get(event.run_id, ())
    if doubts and not judged.changes:
        with_held = replace(before, held=(*before.held, event))
        part = held_summary(with_held, before.filters or {}, _evidence(database, with_held, arrival, answer))
        summary = Results(summary={**before.summary, **part}, judged=judged)
        return _Outcome(
            revision=before.revision,
            receipt=answer,
            cofs=event.cofs,
            results=summary,
            doubts=doubts,
            appended=True,
        )
    if judged.changes:  # the run speaks for or against others, which are accepted or held from now on
        state = replace(
            before,
            events=judged.settled(before.events, [] if doubts else [event]),
            held=judged.aside(before.held, [event] if doubts else []),
        )
    appended = not (judged.changes or _changes_the_past(before, state.events, event))
    if not appended:
        with database.reading() as connection:
            receipts = repository.receipts(connection, before.clutch_id) | {event.run_id: answer}
            levels = repository.levels(connection, before.clutch_id) | _own_levels(arrival)
        reader = reader_with(repository.run_reader(database, before.clutch_id), arrival)
        final, computed = computed_again(state, levels, receipts, reader, evaluated=evaluated)
        computed = with_set_aside(computed, final, judged.held, levels, receipts, reader)
    else:
        final, computed = _one_step(database, state, event, levels, answer, arrival, evaluated)
    evidence = _evidence(database, final, arrival, answer) if needs_evidence(final) else None
    of_others = dict(computed.receipts)
    own_receipt = of_others.pop(event.run_id, answer)
    return _Outcome(
        revision=before.revision,
        receipt=own_receipt,
        cofs=computed.cofs.get(event.run_id, event.cofs),
        results=replace(
            computed,
            receipts=of_others,
            levels={run_id: fits for run_id, fits in computed.levels.items() if run_id != event.run_id},
            summary=summarised(final, computed.tracking or Tracking(), evidence),
            judged=judged,
            teaches=state.kind if not doubts and state.life_of(event).end is not None else None,
        ),
        doubts=doubts,
        appended=appended,
    )


def _receipt(
    before: ClutchHistory, state: ClutchHistory, event: timeline.Event, arrival: Arrival, levels: Levels
) -> tuple[Evaluation, dict[str, str | None]]:
    """The run's receipt, and for each dynamic test (earlier ones and this run) the stationary test used to evaluate its
    loops."""
    evaluated = dict(before.stationary_tests)
    loops: Sequence[FrictionLoop] = ()
    if event.kind == timeline.DYNAMIC:
        test = evaluated[event.run_id] = state.stationary_tests[event.run_id]
        curves = [] if test is None else levels.get(test, [])
        loops = loops_of(arrival.run.channels, state.geometry, state.record.torque_filter, curves)
    answer = receipt(
        before.clutch_id,
        arrival.run,
        arrival.analysis,
        received_at=arrival.received_at,
        cofs=event.cofs,
        loops=loops,
    )
    return answer, evaluated


def _one_step(
    database: Database,
    state: ClutchHistory,
    event: timeline.Event,
    levels: Levels,
    answer: Evaluation,
    arrival: Arrival,
    evaluated: Mapping[str, str | None],
) -> tuple[ClutchHistory, Results]:
    """The results of an added run that changes no earlier mean COF: the filters are carried on by one step if possible."""
    corrected: dict[str, timeline.Corrected] = {}
    if state.extension is not None and event is state.events[-1]:
        runs_before = repository.run_reader(database, state.clutch_id)
        cofs = corrected_newest(state, event, test_of(arrival, state.life_of(event)), runs_before)
        if cofs is not None:
            event = event.corrected(cofs)
            corrected, state = {event.run_id: cofs}, replace(state, events=(*state.events[:-1], event))
    tracking = track(state, newest=event)
    noticed = history_warnings(state.lives, tracking.warnings, run_id=event.run_id)[event.run_id]
    changed = {event.run_id: answer.model_copy(update={"warnings": answer.warnings + noticed})}
    outdated = evaluated != state.stationary_tests
    if tracking.again or outdated:
        with database.reading() as connection:
            receipts = repository.receipts(connection, state.clutch_id) | changed
        if outdated:
            stored = repository.run_reader(database, state.clutch_id)
            loops = loops_again(state, levels, stored, evaluated)
            changed |= {run_id: receipts[run_id].model_copy(update={"loops": items}) for run_id, items in loops.items()}
        if tracking.again:
            changed |= warned_again(state.lives, tracking.warnings, receipts | changed)
    return state, Results(corrected=corrected, receipts=changed, tracking=tracking)


def _evidence(database: Database, state: ClutchHistory, arrival: Arrival, answer: Evaluation) -> ClutchMeasurements:
    """The stored measurements of a clutch with those of the run that comes in."""
    name = arrival.run.run_id
    with database.reading() as connection:
        stored = repository.evidence(connection, state.clutch_id)
    reader = reader_with(repository.run_reader(database, state.clutch_id), arrival)
    engagement = stored_engagement(answer, arrival.analysis.details_to_store(arrival.run))
    return ClutchMeasurements(
        levels={**stored.levels, name: arrival.analysis.fits},
        receipts={**stored.receipts, name: answer},
        engagements={**stored.engagements, **({} if engagement is None else {name: engagement})},
        reader=reader,
    )


def _own_levels(arrival: Arrival) -> dict[str, Sequence[LevelFit]]:
    """The fits of the run that comes in, by its name; empty if it has none."""
    return {arrival.run.run_id: arrival.analysis.fits} if arrival.analysis.fits else {}


def _levels(database: Database, state: ClutchHistory, event: timeline.Event, arrival: Arrival) -> Levels:
    """The fitted levels of all tests if they are needed, else of this run alone."""
    if event.kind != timeline.DYNAMIC and event is state.events[-1] and not event.rebuild and state.adoption is None:
        return _own_levels(arrival)
    with database.reading() as connection:
        return repository.levels(connection, state.clutch_id) | _own_levels(arrival)


def _store(
    connection: Connection,
    clutch_id: str,
    arrival: Arrival,
    columns: raw_columns.Encoded,
    outcome: _Outcome,
    *,
    by: str,
) -> tuple[Receipt, int]:
    """Store the run, its channels and fits, and the changes of other runs; move the revision on. Returns the receipt and
    the new revision."""
    run = arrival.run
    row = RunRow(
        clutch_id=clutch_id,
        run_id=run.run_id,
        kind=run.kind,
        cycles=run.cycles,
        started_at=run.started_at,
        received_at=arrival.received_at,
        content_sha256=run.content_sha256,
        details=arrival.kept | ({FOLLOWS: outcome.revision} if outcome.appended else {}),
        receipt=repository.json_of(outcome.receipt),
        code_version=CODE_VERSION,
        state=outcome.state,
        doubts=tuple(doubted(outcome.doubts)),
        received_by=by,
    )
    run_key = runs.insert(connection, row)
    raw_columns.write(connection, run_key, columns)
    results.write_fits(connection, run_key, repository.fit_rows(arrival.analysis.fits, outcome.cofs))
    revision = repository.store_change(connection, clutch_id, outcome.results, by=by, at=arrival.received_at)
    if outcome.doubts:
        held, at = repository.summary(row), arrival.received_at
        changes.insert(
            connection, clutch_id, changes.HOLD, {}, held, run_id=run.run_id, at=at, by=by, revision=revision
        )
    return repository.receipt(row), revision


def _event_of(arrival: Arrival) -> timeline.Event:
    """The run that comes in as an event of the clutch's history."""
    run = arrival.run
    moment, dated = timeline.moment_of(run.started_at, arrival.received_at)
    duty = run.details.get("duty") or {}
    names = ("cycles", "energy_per_cycle_kj", "initial_speed_rpm", "engagement_duration_s")
    return timeline.Event(
        run_id=run.run_id,
        kind=run.kind,
        cycles=run.cycles,
        moment=moment,
        speed_range=arrival.analysis.speed_range,
        oil_temperature=arrival.analysis.oil_temperature,
        oil_range=arrival.analysis.oil_range,
        **timeline.maintenance_fields(run.details.get("event"), run.details.get("reason")),
        duty=timeline.duty_block(run.cycles, *(duty.get(name) for name in names)),
        dated=dated,
        shown=arrival.shown,
    )


def _changes_the_past(before: ClutchHistory, ordered: Sequence[timeline.Event], event: timeline.Event) -> bool:
    """Whether the run invalidates predictions of other tests.

    A late test or rebuild may make another test the reference, and with it the protocol of all means; under an adopted
    model any late run may bear on the corrections of those after it, and a rebuild ends the model.
    """
    late = event is not ordered[-1]
    if before.adoption is not None and (late or event.rebuild):
        return True
    return late and (event.rebuild or event.speed_range is not None)
