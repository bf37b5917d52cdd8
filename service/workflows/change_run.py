"""A run is withdrawn, restored, confirmed or corrected: its clutch's history changes, and all that follows is computed anew.

Nothing is deleted: the raw data and the hash of what was sent stay, and the audit trail keeps who changed what and why. What
is as it should be already is not changed. Everything is computed before the database is locked, and again where the clutch
has changed meanwhile.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection

from service import records, stored_runs
from service.columns import whole
from service.errors import NotPossibleNowError
from service.lives.history import STATIONARY, Event, order, stationary_tests_of
from service.lives.payloads import notice_items
from service.lives.plausibility.doubts import doubts
from service.lives.prediction_notices import OF_HISTORY
from service.lives.recomputation import (
    ClutchState,
    Levels,
    Receipt,
    Results,
    cofs_among,
    computed_anew,
    computed_aside,
)
from service.lives.run_analysis import analyse
from storage import changes, clutches, results, runs
from storage.changes import NewChange
from storage.engine.database import Database
from storage.runs import RunRow


@dataclass(frozen=True, slots=True, kw_only=True)
class _Request:
    """What is asked for, by whom, when and why; `cycles` where a run is corrected."""

    clutch_id: str
    run_id: str
    action: str
    reason: str
    by: str
    at: str
    cycles: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Loaded:
    """A run and its clutch at one revision: `state` holds the run where it is accepted, `event` is it in any case."""

    row: RunRow
    event: Event
    state: ClutchState
    levels: Levels
    receipts: Mapping[str, Receipt]
    withdrawn_from: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Changed:
    """The run as it is to be, its mean COFs where it is not accepted, and the results of the clutch's history."""

    row: RunRow
    aside: Mapping[float, Any] | None
    results: Results


def withdraw(database: Database, clutch_id: str, run_id: str, *, reason: str, by: str, at: str) -> Receipt:
    """Take a run out of its clutch's history; returns its receipt. Raises NotFoundError."""
    return _change(
        database, _Request(clutch_id=clutch_id, run_id=run_id, action=changes.WITHDRAW, reason=reason, by=by, at=at)
    )


def restore(database: Database, clutch_id: str, run_id: str, *, reason: str, by: str, at: str) -> Receipt:
    """Take a withdrawal back: the run is accepted or held as before; returns its receipt. Raises NotFoundError."""
    return _change(
        database, _Request(clutch_id=clutch_id, run_id=run_id, action=changes.RESTORE, reason=reason, by=by, at=at)
    )


def confirm(database: Database, clutch_id: str, run_id: str, *, reason: str, by: str, at: str) -> Receipt:
    """Accept a held run as it is; returns its receipt. Raises NotFoundError."""
    return _change(
        database, _Request(clutch_id=clutch_id, run_id=run_id, action=changes.CONFIRM, reason=reason, by=by, at=at)
    )


def correct(
    database: Database, clutch_id: str, run_id: str, *, cycles: float, reason: str, by: str, at: str
) -> Receipt:
    """Put a run to other cycles, where doubts are asked anew; returns its receipt.

    Raises NotFoundError, and NotPossibleNowError for a run that is withdrawn.
    """
    return _change(
        database,
        _Request(
            clutch_id=clutch_id, run_id=run_id, action=changes.CORRECT, reason=reason, by=by, at=at, cycles=cycles
        ),
    )


def _change(database: Database, request: _Request) -> Receipt:
    attempts = records.attempts(request.clutch_id)
    while True:
        next(attempts)
        loaded = _load(database, request)
        row = _as_asked(database, loaded, request)
        if (row.state, row.cycles) == (loaded.row.state, loaded.row.cycles):
            return records.receipt(loaded.row)
        changed = _computed(database, loaded, row)
        with database.writing(of=request.clutch_id) as connection:
            if records.unchanged(connection, request.clutch_id, loaded.state.revision):
                _store(connection, loaded, changed, request)
                return records.receipt(changed.row)


def _load(database: Database, request: _Request) -> _Loaded:
    clutch_id, run_id = request.clutch_id, request.run_id
    with database.reading() as connection:
        row = stored_runs.run(connection, clutch_id, run_id)
        state = records.state(connection, clutch_id)
        events = {event.run_id: event for event in state.events} | records.set_aside(connection, clutch_id)
        trail = changes.page(connection, clutch_id, run_id=run_id) if row.state == runs.WITHDRAWN else []
        return _Loaded(
            row=row,
            event=events[run_id],
            state=state,
            levels=records.levels(connection, clutch_id),
            receipts=records.receipts(connection, clutch_id),
            withdrawn_from=next((change.before["state"] for change in trail if change.action == changes.WITHDRAW), ""),
        )


def _as_asked(database: Database, loaded: _Loaded, request: _Request) -> RunRow:
    """The run as it is asked for; as it is where that changes nothing."""
    row = loaded.row
    if request.action == changes.WITHDRAW:
        return replace(row, state=runs.WITHDRAWN)
    if request.action == changes.RESTORE:
        return replace(row, state=loaded.withdrawn_from) if row.state == runs.WITHDRAWN else row
    if request.action == changes.CONFIRM:
        return replace(row, state=runs.ACCEPTED) if row.state == runs.HELD else row
    if row.state == runs.WITHDRAWN:
        raise NotPossibleNowError(f"run {row.run_id!r} is withdrawn: restore it before it is corrected")
    if request.cycles is None or request.cycles == row.cycles:
        return row
    return _corrected(database, loaded, request.cycles)


def _corrected(database: Database, loaded: _Loaded, cycles: float) -> RunRow:
    """The run at other cycles: accepted where it is plausible there, else held."""
    row, sent_cycles = loaded.row, loaded.row.cycles if loaded.row.sent_cycles is None else loaded.row.sent_cycles
    others = replace(loaded.state, events=_without(loaded.state.events, row.run_id))
    sent = replace(stored_runs.run_reader(database, row.clutch_id).read(row.run_id), cycles=cycles)
    event = loaded.event.at(cycles)
    event = replace(event, cofs=cofs_among(others, event, loaded.levels.get(row.run_id, ())))
    analysis = analyse(sent, others.geometry, others.record.torque_filter)
    if "time_s" in sent.channels and sent.kind == STATIONARY:  # as on arrival: its plateaus stand for a long record
        sent = replace(sent, channels={})
    doubtful = doubts(sent, analysis, event, others)
    return replace(
        row,
        cycles=cycles,
        sent_cycles=None if cycles == sent_cycles else sent_cycles,
        state=runs.HELD if doubtful else runs.ACCEPTED,
        doubts=tuple(notice_items(doubtful)),
    )


def _computed(database: Database, loaded: _Loaded, row: RunRow) -> _Changed:
    """All that follows from the run as it is to be."""
    before, run_id = loaded.state, row.run_id
    event = loaded.event.at(row.cycles)
    own = [event] if row.state == runs.ACCEPTED else []
    after = replace(before, events=order([*_without(before.events, run_id), *own]))
    receipts = {**loaded.receipts, run_id: loaded.receipts[run_id] | {"cycles": whole(row.cycles)}}
    reader = stored_runs.run_reader(database, row.clutch_id)
    computed = Results()
    if own or loaded.row.state == runs.ACCEPTED:
        tests = reader.stationary_tests(after.lives[-1]) if after.events else iter(())
        evaluated = stationary_tests_of(before.events)
        after, computed = computed_anew(after, loaded.levels, receipts, tests, reader, evaluated=evaluated)
    aside = None
    if not own:
        aside, parts = computed_aside(after, event, loaded.levels, reader)
        warnings = [warning for warning in receipts[run_id]["warnings"] if warning["code"] not in OF_HISTORY]
        receipts[run_id] |= parts | {"warnings": warnings}
    receipt = computed.receipts.get(run_id, receipts[run_id])
    computed = replace(computed, receipts={**computed.receipts, run_id: receipt})
    return _Changed(row=replace(row, receipt=receipt), aside=aside, results=computed)


def _without(events: tuple[Event, ...], run_id: str) -> tuple[Event, ...]:
    return tuple(event for event in events if event.run_id != run_id)


def _store(connection: Connection, loaded: _Loaded, changed: _Changed, request: _Request) -> None:
    """The run as it is to be and what follows, and the entry of the audit trail; the revision moves on."""
    row = changed.row
    runs.set_state(
        connection,
        row.run_key,
        state=row.state,
        cycles=row.cycles,
        sent_cycles=row.sent_cycles,
        doubts=row.doubts,
    )
    if changed.aside is not None:
        fits = records.fit_rows(loaded.levels.get(row.run_id, ()), changed.aside)
        results.write_fits(connection, row.run_key, fits)
    records.store(connection, row.clutch_id, changed.results)
    before, after = records.summary(loaded.row), records.summary(row)
    if before["doubts"] == after["doubts"]:
        del before["doubts"], after["doubts"]
    change = NewChange(
        clutch_id=row.clutch_id,
        run_id=row.run_id,
        at=request.at,
        by=request.by,
        action=request.action,
        reason=request.reason,
        before=before,
        after=after,
        revision=clutches.bump_revision(connection, row.clutch_id),
    )
    changes.insert(connection, change)
