"""A run is withdrawn, restored, confirmed, corrected or read again: its clutch's history and all that follows change.

Nothing is deleted: what was sent (of a file that is read again, the file) and its hash stay, and the audit trail keeps who
changed what and why. What is as it should be already is not changed. Everything is computed before the database is locked,
and again where the clutch has changed meanwhile.
"""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import compress
from pathlib import Path

from sqlalchemy import Connection

from service import repository
from service.api.run import Evaluation, Receipt
from service.channels import whole
from service.clutch.analysis import analyse
from service.clutch.incoming_run import IncomingRun
from service.clutch.items import doubted, receipt
from service.clutch.model_correction import RunReader
from service.clutch.plausibility.doubts import Judged, doubts_alone, doubts_together
from service.clutch.recomputation import (
    Arrival,
    ClutchHistory,
    Levels,
    Results,
    cofs_among,
    computed_again,
    reader_with,
    with_set_aside,
)
from service.clutch.summary import StoredSummary
from service.clutch.timeline import (
    STATIONARY,
    Event,
    Shown,
    lives_of,
    order,
    require_within_ends,
)
from service.clutch.with_held import held_summary, summarised
from service.errors import NotFoundError, Notice, NotPossibleNowError
from service.runs.upload import file_kind, read_file_run
from storage import changes, raw_columns, runs
from storage.engine.database import Database
from storage.raw_columns import Encoded
from storage.runs import RunRow


@dataclass(frozen=True, slots=True, kw_only=True)
class _Request:
    """A change of runs as requested: its action, reason, author and time; `cycles` by run_id for corrected runs."""

    clutch_id: str
    run_ids: tuple[str, ...]
    action: str
    reason: str
    by: str
    at: str
    cycles: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Loaded:
    """Runs to be changed and their clutch, at one revision: `state` has the accepted runs; `events` and `rows` are the
    runs to be changed, in the order of the history."""

    rows: tuple[RunRow, ...]
    events: tuple[Event, ...]
    state: ClutchHistory
    levels: Levels
    receipts: Mapping[str, Evaluation]
    withdrawn_from: Mapping[str, str]
    again: Arrival | None = None

    @property
    def row(self) -> RunRow:
        (row,) = self.rows
        return row

    @property
    def event(self) -> Event:
        (event,) = self.events
        return event

    @property
    def others(self) -> ClutchHistory:
        """The clutch's history without the runs being changed, both accepted and held."""
        names = {event.run_id for event in self.events}
        events = tuple(event for event in self.state.events if event.run_id not in names)
        held = tuple(event for event in self.state.held if event.run_id not in names)
        return replace(self.state, events=events, held=held)

    def reader(self, database: Database) -> RunReader:
        """A reader of the clutch's runs; a run whose file is being read again is given in its new form."""
        stored = repository.run_reader(database, self.state.clutch_id)
        return stored if self.again is None else reader_with(stored, self.again)


def change(
    database: Database,
    clutch_id: str,
    run_ids: Sequence[str],
    *,
    action: str,
    reason: str,
    by: str,
    at: str,
    cycles: Mapping[str, float] | None = None,
) -> list[Receipt]:
    """Change runs in one step; returns their receipts in the order asked for.

    `action` of storage.changes: WITHDRAW takes a run out of its clutch's history, RESTORE takes that back (it is accepted or
    held as before), CONFIRM accepts those that are held as they are, CORRECT puts runs to other `cycles`, by run_id, where
    doubts are asked again, of all of them together. Raises NotFoundError where one is none of the clutch's, and
    NotPossibleNowError where one that is withdrawn is to be corrected; then nothing is changed.
    """
    names = tuple(dict.fromkeys(run_ids))
    request = _Request(
        clutch_id=clutch_id, run_ids=names, action=action, reason=reason, by=by, at=at, cycles=cycles or {}
    )
    receipts = {answer.run_id: answer for answer in _change(database, request)}
    return [receipts[run_id] for run_id in names]


def answer_doubt(
    database: Database, clutch_id: str, doubt_id: str, *, accept: bool, reason: str, by: str, at: str
) -> list[Receipt]:
    """Settle a doubt about several held runs in one step; returns their receipts. If its hypothesis is accepted, the runs
    get their likely cycles, or are withdrawn where they are another clutch's; if not, they are accepted as sent.

    Raises NotFoundError if no run is held for this doubt.
    """
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, state="held")
    doubts = {row.run_id: doubt for row in rows for doubt in row.doubts if doubt.get("id") == doubt_id}
    if not doubts:
        raise NotFoundError(f"no run of clutch {clutch_id!r} is held for a doubt {doubt_id[:80]!r}")
    cycles = {run_id: float(doubt["likely_cycles"]) for run_id, doubt in doubts.items() if "likely_cycles" in doubt}
    settled = (changes.CORRECT if cycles else changes.WITHDRAW) if accept else changes.CONFIRM
    said = reason or f"the doubt {doubt_id} is {'right' if accept else 'wrong'}"
    return change(database, clutch_id, list(doubts), action=settled, reason=said, by=by, at=at, cycles=cycles)


def read_again(
    database: Database, clutch_id: str, run_id: str, folder: Path, *, rig: str, reason: str, by: str, at: str
) -> Receipt:
    """Read a run's file again, by another or a mended rig profile; the run is judged again. Returns its receipt. The
    file is unpacked below `folder`.

    Raises NotFoundError, NotPossibleNowError for a run that is withdrawn or has no file, and the errors of reading.
    """
    with database.reading() as connection:
        row = repository.run(connection, clutch_id, run_id)
        profile = repository.rig(connection, rig)
        stored = raw_columns.file_of(connection, row.run_key)
    if stored is None:
        raise NotPossibleNowError(f"run {run_id!r} was not sent as a file: there is no file to read again")
    file, sent_cycles = row.details["file"], row.cycles if row.sent_cycles is None else row.sent_cycles
    with tempfile.TemporaryDirectory(dir=folder) as place:
        path = Path(place) / "run"
        with path.open("wb") as unpacked:
            stored.copy_to(unpacked)
        run = read_file_run(
            path,
            filename=file["filename"],
            kind=file_kind(row.kind),
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
        return repository.receipt(row)
    request = _Request(clutch_id=clutch_id, run_ids=(run_id,), action=changes.REREAD, reason=reason, by=by, at=at)
    return _change(database, request, run, repository.placed(database, raw_columns.encoded(run.channels)))[0]


def _change(
    database: Database, request: _Request, again: IncomingRun | None = None, columns: Encoded | None = None
) -> list[Receipt]:
    """Apply a request to its runs and store what follows from them; the receipts. Computed again if the clutch changed
    meanwhile. `again`, `columns`: a run that was read again from its file."""
    attempts = repository.attempts(request.clutch_id)
    while True:
        next(attempts)
        loaded = _load(database, request)
        if again is not None:
            loaded = _with(loaded, again)
        wanted = _as_asked(database, loaded, request)
        differs = [
            again is not None or (row.state, row.cycles) != (new.state, new.cycles)
            for row, new in zip(loaded.rows, wanted, strict=True)
        ]
        same = [row for row, is_other in zip(loaded.rows, differs, strict=True) if not is_other]
        if not any(differs):
            return [repository.receipt(row) for row in same]
        rows, events = tuple(compress(loaded.rows, differs)), tuple(compress(loaded.events, differs))
        loaded = replace(loaded, rows=rows, events=events)
        changed, computed = _computed(database, loaded, list(compress(wanted, differs)))
        with database.writing(of=request.clutch_id) as connection:
            if repository.unchanged(connection, request.clutch_id, loaded.state.revision):
                if columns is not None:
                    raw_columns.rewrite(connection, loaded.row.run_key, columns)
                _store(connection, loaded, changed, computed, request)
                return [repository.receipt(row) for row in (*changed, *same)]


def _with(loaded: _Loaded, run: IncomingRun) -> _Loaded:
    """A run as newly read from its file, with its clutch. Raises InvalidError if the new form cannot be evaluated."""
    analysis = analyse(run, loaded.state.geometry, loaded.state.record.torque_filter)
    run_id, received_at = run.run_id, loaded.row.received_at
    answer = receipt(loaded.row.clutch_id, run, analysis, received_at=received_at)
    shown, odd = doubts_alone(run, analysis, loaded.state.geometry)
    sampled, of_test = "time_s" in run.channels, ("speed_range", "oil_temperature", "oil_range")
    event = replace(loaded.event, shown=shown, **{name: getattr(analysis, name) for name in of_test})
    return replace(
        loaded,
        events=(event,),
        levels={**loaded.levels, run_id: analysis.fits},
        receipts={**loaded.receipts, run_id: answer},
        again=Arrival(run=run, sampled=sampled, analysis=analysis, shown=shown, odd=odd, received_at=received_at),
    )


def _load(database: Database, request: _Request) -> _Loaded:
    """The runs of a request with all that is needed to compute the change, read in one transaction."""
    clutch_id = request.clutch_id
    with database.reading() as connection:
        rows = {run_id: repository.run(connection, clutch_id, run_id) for run_id in request.run_ids}
        state = repository.state(connection, clutch_id)
        by_name = {event.run_id: event for event in state.events} | repository.set_aside(connection, clutch_id)
        events = order([by_name[run_id] for run_id in rows])
        withdrawn = [run_id for run_id, row in rows.items() if row.state == runs.WITHDRAWN]
        trails = {run_id: changes.page(connection, clutch_id, run_id=run_id) for run_id in withdrawn}
        return _Loaded(
            rows=tuple(rows[event.run_id] for event in events),
            events=events,
            state=state,
            levels=repository.levels(connection, clutch_id),
            receipts=repository.receipts(connection, clutch_id),
            withdrawn_from={
                run_id: next(change.before["state"] for change in trail if change.action == changes.WITHDRAW)
                for run_id, trail in trails.items()
            },
        )


def _as_asked(database: Database, loaded: _Loaded, request: _Request) -> tuple[RunRow, ...]:
    """The runs in the requested states; an unaffected run is returned unchanged."""
    if request.action == changes.CONFIRM:
        return tuple(replace(row, state=runs.ACCEPTED) if row.state == runs.HELD else row for row in loaded.rows)
    if request.action == changes.WITHDRAW:
        return tuple(replace(row, state=runs.WITHDRAWN) for row in loaded.rows)
    if request.action == changes.RESTORE:
        return tuple(
            replace(row, state=loaded.withdrawn_from[row.run_id]) if row.state == runs.WITHDRAWN else row
            for row in loaded.rows
        )
    for row in loaded.rows:
        if row.state == runs.WITHDRAWN:
            raise NotPossibleNowError(f"run {row.run_id!r} is withdrawn: restore it before it is changed")
    cycles = [request.cycles.get(row.run_id, row.cycles) for row in loaded.rows]
    if loaded.again is None and cycles == [row.cycles for row in loaded.rows]:
        return loaded.rows
    return _judged(database, loaded, cycles)


def _judged(database: Database, loaded: _Loaded, cycles: Sequence[float]) -> tuple[RunRow, ...]:
    """The runs at their new cycles, judged together: accepted if plausible there, else held."""
    other_runs, alone = loaded.others, dict[str, tuple[Notice, ...]]()
    events = []
    for row, event, at in zip(loaded.rows, loaded.events, cycles, strict=True):
        moved = event.at(at)
        moved = replace(moved, cofs=cofs_among(other_runs, moved, loaded.levels.get(row.run_id, ())))
        shown, alone[row.run_id] = _alone(database, loaded, row, at)
        events.append(replace(moved, shown=shown, confirmed=False))
    asked = [event for event in events if not alone[event.run_id]]
    together: Mapping[str, tuple[Notice, ...]] = {}
    if asked:
        among = replace(other_runs, held=order([*other_runs.held, *asked[:-1]]))
        together = _together(among, asked[-1]).doubts
    rows = []
    for row, at in zip(loaded.rows, cycles, strict=True):
        doubtful = alone[row.run_id] or together.get(row.run_id, ())
        sent_cycles = row.cycles if row.sent_cycles is None else row.sent_cycles
        state, items = runs.HELD if doubtful else runs.ACCEPTED, tuple(doubted(doubtful))
        kept = None if at == sent_cycles else sent_cycles
        rows.append(replace(row, cycles=at, sent_cycles=kept, state=state, doubts=items))
    return tuple(rows)


def _alone(database: Database, loaded: _Loaded, row: RunRow, cycles: float) -> tuple[Shown | None, tuple[Notice, ...]]:
    """A run's friction (`Shown`) at other cycles, and the doubts about it that need no other run."""
    sent = replace(loaded.reader(database).read(row.run_id), cycles=cycles)
    if loaded.again is None:
        analysis = analyse(sent, loaded.state.geometry, loaded.state.record.torque_filter)
    else:
        analysis = loaded.again.analysis
    if "time_s" in sent.channels and sent.kind == STATIONARY:  # as on arrival: its plateaus stand for a long record
        sent = replace(sent, channels={})
    return doubts_alone(sent, analysis, loaded.state.geometry)


def _together(others: ClutchHistory, incoming: Event | None, changed: Sequence[Event] = ()) -> Judged:
    """The plausibility judgement of a clutch's runs, with an incoming and with changed ones."""
    corrected = others.extension is not None
    return doubts_together(others.events, others.held, incoming, others.geometry, corrected=corrected, changed=changed)


def _judged_with(loaded: _Loaded, accepted: Sequence[Event]) -> Judged:
    """The judgement on all other runs, given the changed runs as requested, with these of them `accepted`."""
    other_runs = loaded.others
    for event in accepted:
        cofs = cofs_among(other_runs, event, loaded.levels.get(event.run_id, ()))
        other_runs = replace(other_runs, events=order([*other_runs.events, replace(event, cofs=cofs, confirmed=True)]))
    return _together(other_runs, None, [*loaded.events, *accepted])


def _computed(database: Database, loaded: _Loaded, rows: Sequence[RunRow]) -> tuple[tuple[RunRow, ...], Results]:
    """The runs in their new states with receipts, and all results that follow."""
    before, other_runs = loaded.state, loaded.others
    pairs = [(row, event.at(row.cycles)) for row, event in zip(rows, loaded.events, strict=True)]
    accepted = [event for row, event in pairs if row.state == runs.ACCEPTED]
    out = [event for row, event in pairs if row.state != runs.ACCEPTED]
    judged = _judged_with(loaded, accepted)
    require_within_ends(lives_of(order([*other_runs.events, *accepted])))
    held_runs = judged.aside(other_runs.held, [event for row, event in pairs if row.state == runs.HELD])
    after = replace(before, events=judged.settled(other_runs.events, accepted), held=held_runs)
    receipts = {**loaded.receipts}
    receipts |= {row.run_id: receipts[row.run_id].model_copy(update={"cycles": whole(row.cycles)}) for row in rows}
    reader = loaded.reader(database)
    computed = Results()
    if accepted or judged.changes or any(row.state == runs.ACCEPTED for row in loaded.rows):
        evaluated = dict(before.stationary_tests)
        if loaded.again is not None:  # its own loops, and those that are held against its curves
            rejudged = loaded.row.run_id
            evaluated = {loop: test for loop, test in evaluated.items() if rejudged not in (loop, test)}
        after, computed = computed_again(after, loaded.levels, receipts, reader, evaluated=evaluated)
    computed = with_set_aside(computed, after, [*judged.held, *out], loaded.levels, receipts, reader)
    own_names = {row.run_id for row in rows}
    changed = {name: receipts[name] for name in own_names} | dict(computed.receipts)
    evidence = repository.evidence_for(database, after, reader)
    if evidence is not None:
        evidence = replace(evidence, levels=loaded.levels, receipts={**receipts, **changed})
    if computed.tracking is None:
        summary: StoredSummary = {**before.summary, **held_summary(after, {}, evidence)}
    else:
        summary = summarised(after, computed.tracking, evidence)
    teaches = any(
        state.life_of(mended).end is not None
        for state in (before, after)
        for mended in state.events
        if mended.run_id in own_names
    )
    kind = after.kind if teaches else None
    computed = replace(computed, receipts=changed, summary=summary, judged=judged, teaches=kind)
    if loaded.again is not None:
        name, fits = loaded.row.run_id, loaded.again.analysis.fits
        computed = replace(computed, details={name: loaded.again.kept}, levels={name: fits, **computed.levels})
    return tuple(replace(row, receipt=repository.json_of(changed[row.run_id])) for row in rows), computed


def _store(
    connection: Connection, loaded: _Loaded, changed: Sequence[RunRow], computed: Results, request: _Request
) -> None:
    """Store the changed runs, the results that follow and the entries in the audit trail; move the revision on."""
    clutch_id = request.clutch_id
    for row in changed:
        runs.set_state(
            connection, row.run_key, state=row.state, cycles=row.cycles, sent_cycles=row.sent_cycles, doubts=row.doubts
        )
    revision = repository.store_change(connection, clutch_id, computed, by=request.by, at=request.at)
    for was, row in zip(loaded.rows, changed, strict=True):
        before, after = repository.summary(was), repository.summary(row)
        if loaded.again is not None:
            before |= _how_read(was.details["file"])
            after |= _how_read(loaded.again.run.file or {})
        if before["doubts"] == after["doubts"]:
            del before["doubts"], after["doubts"]
        entry = {"run_id": row.run_id, "at": request.at, "by": request.by, "reason": request.reason}
        changes.insert(connection, clutch_id, request.action, before, after, revision=revision, **entry)


def _how_read(file: Mapping[str, object]) -> dict[str, object]:
    """The rig profile and the settings with which a file was read."""
    return {"rig": file["rig"], "reading": file["reading"]}
