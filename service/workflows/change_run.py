"""A run is withdrawn, restored, confirmed, corrected or read again: its clutch's history and all that follows change.

Nothing is deleted: what was sent and its hash stay, and the audit trail keeps who changed what and why. Of a run that was
sent as a file this is the file: its channels are replaced where it is read again by another profile. What
is as it should be already is not changed. Everything is computed before the database is locked, and again where the clutch
has changed meanwhile.
"""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection

from service import records, stored_runs
from service.columns import whole
from service.errors import NotPossibleNowError
from service.lives.history import (
    STATIONARY,
    ByPressure,
    Event,
    life_with,
    order,
    require_within_ends,
    stationary_tests_of,
)
from service.lives.incoming_run import IncomingRun
from service.lives.model_correction import RunReader
from service.lives.outlook import held_part, summarised
from service.lives.payloads import notice_items, receipt
from service.lives.plausibility.doubts import Judged, doubts_alone, doubts_together
from service.lives.recomputation import (
    Arrival,
    ClutchState,
    Levels,
    Receipt,
    Results,
    cofs_among,
    computed_again,
    reader_with,
    set_aside,
)
from service.lives.run_analysis import analyse
from service.run_files.upload import read_file_run
from service.settings import CODE_VERSION
from storage import changes, channels, clutches, results, runs
from storage.changes import NewChange
from storage.channels import Encoded
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
    again: Arrival | None = None

    def reader(self, database: Database) -> RunReader:
        """The clutch's runs, this one as its file is read again."""
        stored = stored_runs.run_reader(database, self.row.clutch_id)
        return stored if self.again is None else reader_with(stored, self.again)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Changed:
    """The run as it is to be, what that changes in the doubts about others, the mean COFs of those of them that are then
    not accepted, by run_id, and the results of the clutch's history; whether that changes what an ended life
    `teaches` its fleet."""

    row: RunRow
    judged: Judged
    aside: Mapping[str, ByPressure]
    results: Results
    teaches: bool = False


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
    """Put a run to other cycles, where doubts are asked again; returns its receipt.

    Raises NotFoundError, and NotPossibleNowError for a run that is withdrawn.
    """
    return _change(
        database,
        _Request(
            clutch_id=clutch_id, run_id=run_id, action=changes.CORRECT, reason=reason, by=by, at=at, cycles=cycles
        ),
    )


def read_again(
    database: Database, clutch_id: str, run_id: str, *, rig: str, reason: str, by: str, at: str, folder: Path
) -> Receipt:
    """Read a run's file again, by another rig's profile or by one that was mended, where doubts are asked again; returns its
    receipt. The file is unpacked below `folder`.

    Raises NotFoundError, NotPossibleNowError for a run that is withdrawn or has no file, and as reading does.
    """
    with database.reading() as connection:
        row = stored_runs.run(connection, clutch_id, run_id)
        profile = records.rig(connection, rig)
        stored = channels.file_of(connection, row.run_key)
    if stored is None:
        raise NotPossibleNowError(f"run {run_id!r} was not sent as a file: there is none to read again")
    file, sent_cycles = row.details["file"], row.cycles if row.sent_cycles is None else row.sent_cycles
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place) / "run"
        with path.open("wb") as unpacked:
            stored.copy_to(unpacked)
        run = read_file_run(
            path,
            filename=file["filename"],
            kind=row.kind,
            cycles=sent_cycles,
            run_id=run_id,
            started_at=None if row.started_at is None else datetime.fromisoformat(row.started_at),
            origin=row.details["origin"],
            profile=profile,
            rig=rig,
        )
    read = {name: value for name, value in file.items() if name != "content_sha256"} | dict(run.file or {})
    if run.content_sha256 != row.content_sha256:
        read["content_sha256"] = run.content_sha256
    run = replace(run, cycles=row.cycles, content_sha256=row.content_sha256, file=read)
    if read == file:
        return records.receipt(row)
    request = _Request(clutch_id=clutch_id, run_id=run_id, action=changes.REREAD, reason=reason, by=by, at=at)
    return _change(database, request, run, stored_runs.placed(database, channels.encoded(run.channels)))


def _change(
    database: Database, request: _Request, again: IncomingRun | None = None, columns: Encoded | None = None
) -> Receipt:
    attempts = records.attempts(request.clutch_id)
    while True:
        next(attempts)
        loaded = _load(database, request)
        if again is not None:
            loaded = _with(loaded, again)
        row = _as_asked(database, loaded, request)
        if again is None and (row.state, row.cycles) == (loaded.row.state, loaded.row.cycles):
            return records.receipt(loaded.row)
        changed = _computed(database, loaded, row)
        with database.writing(of=request.clutch_id) as connection:
            if records.unchanged(connection, request.clutch_id, loaded.state.revision):
                if columns is not None:
                    channels.rewrite(connection, row.run_key, columns)
                _store(connection, loaded, changed, request)
                return records.receipt(changed.row)


def _with(loaded: _Loaded, run: IncomingRun) -> _Loaded:
    """A run and its clutch, the run as its file is read again. Raises InvalidError where it cannot be evaluated so."""
    analysis = analyse(run, loaded.state.geometry, loaded.state.record.torque_filter)
    run_id, received_at = run.run_id, loaded.row.received_at
    answer = receipt(
        loaded.row.clutch_id,
        run,
        received_at=received_at,
        levels=analysis.fits,
        cofs={},
        warnings=analysis.warnings,
        engagement=analysis.engagement,
    )
    shown, odd = doubts_alone(run, analysis, loaded.state.geometry)
    return replace(
        loaded,
        event=replace(
            loaded.event, speed_range=analysis.speed_range, oil_temperature=analysis.oil_temperature, shown=shown
        ),
        levels={**loaded.levels, run_id: analysis.fits},
        receipts={**loaded.receipts, run_id: answer},
        again=Arrival(
            run=run,
            sampled="time_s" in run.channels,
            analysis=analysis,
            shown=shown,
            odd=odd,
            received_at=received_at,
        ),
    )


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
        raise NotPossibleNowError(f"run {row.run_id!r} is withdrawn: restore it before it is changed")
    if loaded.again is not None:
        return _judged(database, loaded, row.cycles)
    if request.cycles is None or request.cycles == row.cycles:
        return row
    return _judged(database, loaded, request.cycles)


def _judged(database: Database, loaded: _Loaded, cycles: float) -> RunRow:
    """The run at other cycles: accepted where it is plausible there, else held."""
    row, sent_cycles = loaded.row, loaded.row.cycles if loaded.row.sent_cycles is None else loaded.row.sent_cycles
    others = _others(loaded)
    sent = replace(loaded.reader(database).read(row.run_id), cycles=cycles)
    event = loaded.event.at(cycles)
    event = replace(event, cofs=cofs_among(others, event, loaded.levels.get(row.run_id, ())))
    again = loaded.again
    analysis = analyse(sent, others.geometry, others.record.torque_filter) if again is None else again.analysis
    if "time_s" in sent.channels and sent.kind == STATIONARY:  # as on arrival: its plateaus stand for a long record
        sent = replace(sent, channels={})
    shown, doubtful = doubts_alone(sent, analysis, others.geometry)
    if not doubtful:
        doubtful = _together(others, replace(event, shown=shown, confirmed=False)).doubts.get(row.run_id, ())
    return replace(
        row,
        cycles=cycles,
        sent_cycles=None if cycles == sent_cycles else sent_cycles,
        state=runs.HELD if doubtful else runs.ACCEPTED,
        doubts=tuple(notice_items(doubtful)),
    )


def _others(loaded: _Loaded) -> ClutchState:
    """The clutch without the run."""
    events, held = (_without(events, loaded.row.run_id) for events in (loaded.state.events, loaded.state.held))
    return replace(loaded.state, events=events, held=held)


def _together(others: ClutchState, changed: Event | None) -> Judged:
    corrected = others.extension is not None
    return doubts_together(others.events, others.held, changed, others.geometry, corrected=corrected)


def _judged_with(loaded: _Loaded, row: RunRow) -> Judged:
    """What becomes of the other runs; the run itself is as it was asked for."""
    others, event = _others(loaded), loaded.event.at(row.cycles)
    if row.state == runs.ACCEPTED:
        event = replace(event, cofs=cofs_among(others, event, loaded.levels.get(row.run_id, ())), confirmed=True)
        others = replace(others, events=order([*others.events, event]))
    return _together(others, None)


def _computed(database: Database, loaded: _Loaded, row: RunRow) -> _Changed:
    """All that follows from the run as it is to be."""
    before, run_id = loaded.state, row.run_id
    judged = _judged_with(loaded, row)
    event = loaded.event.at(row.cycles)
    own = [event] if row.state == runs.ACCEPTED else []
    require_within_ends(order([*_without(before.events, run_id), *own]))
    held = judged.aside(_without(before.held, run_id), [event] if row.state == runs.HELD else [])
    after = replace(before, events=judged.settled(_without(before.events, run_id), own), held=held)
    receipts = {**loaded.receipts, run_id: loaded.receipts[run_id] | {"cycles": whole(row.cycles)}}
    reader = loaded.reader(database)
    computed = Results()
    if own or loaded.row.state == runs.ACCEPTED or judged.changes:
        tests = reader.stationary_tests(after.lives[-1]) if after.events else iter(())
        evaluated = stationary_tests_of(before.events)
        if loaded.again is not None:  # its own loops, and those that are held against its curves
            evaluated = {loop: test for loop, test in evaluated.items() if run_id not in (loop, test)}
        after, computed = computed_again(after, loaded.levels, receipts, tests, reader, evaluated=evaluated)
    aside = {}
    for other in [*judged.held, *([] if own else [event])]:
        name = other.run_id
        aside[name], receipts[name] = set_aside(after, other, loaded.levels, receipts[name], reader)
    changed = {name: receipts[name] for name in (run_id, *aside)} | dict(computed.receipts)
    evidence = stored_runs.evidence_for(database, after, reader)
    if evidence is not None:
        evidence = replace(evidence, levels=loaded.levels, receipts={**receipts, **changed})
    if computed.tracking is None:
        summary = {**before.summary, **held_part(after, {}, evidence)}
    else:
        summary = summarised(after, computed.tracking, evidence)
    computed = replace(computed, receipts=changed, summary=summary)
    teaches = any(
        life_with(state.events, mended).end is not None
        for state in (before, after)
        for mended in state.events
        if mended.run_id == run_id
    )
    own_receipt = changed[run_id]
    return _Changed(
        row=replace(row, receipt=own_receipt), judged=judged, aside=aside, results=computed, teaches=teaches
    )


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
    before, after = records.summary(loaded.row), records.summary(row)
    if loaded.again is not None:
        run = loaded.again.run
        runs.set_results(connection, row.run_key, loaded.again.kept, row.receipt, CODE_VERSION)
        results.write_fits(connection, row.run_key, records.fit_rows(loaded.again.analysis.fits, {}))
        before, after = before | _read_as(loaded.row.details["file"]), after | _read_as(run.file or {})
    if row.run_id in changed.aside:
        fits = records.fit_rows(loaded.levels.get(row.run_id, ()), changed.aside[row.run_id])
        results.write_fits(connection, row.run_key, fits)
    records.store(connection, row.clutch_id, changed.results)
    revision = clutches.bump_revision(connection, row.clutch_id)
    records.store_judged(
        connection, row.clutch_id, changed.judged, changed.aside, loaded.levels, at=request.at, revision=revision
    )
    if changed.teaches:
        records.ask_fleet_refresh(connection, by=request.by, at=request.at)
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
        revision=revision,
    )
    changes.insert(connection, change)


def _read_as(file: Mapping[str, Any]) -> dict[str, Any]:
    """What the audit trail keeps of how a run's file was read."""
    return {"rig": file["rig"], "reading": file["reading"]}
