"""Stored runs as they were sent, each read in a transaction of its own when it is asked for; what was measured of a clutch;
and all results of a clutch computed again from its runs.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection

from service import records
from service.columns import whole
from service.errors import InvalidError, NotFoundError
from service.lives.engagements import DUTY_KINDS, StoredEngagement, stored_engagement
from service.lives.history import Event, order, stationary_tests_of
from service.lives.incoming_run import IncomingRun, content_hash
from service.lives.model_correction import RunReader
from service.lives.outlook import Evidence, engagement_rows, needs_evidence, summarised
from service.lives.payloads import receipt
from service.lives.plausibility.doubts import doubts_alone
from service.lives.recomputation import ClutchState, Levels, Receipt, Results, Tracking, computed_again, with_set_aside
from service.lives.run_analysis import analyse
from service.schemas.clutch import ClutchIn
from storage import channels, runs
from storage.blobs import raw_stores
from storage.checksums import allow_damage
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.runs import RunRow

_log = logging.getLogger("clutchlife")


def evidence(connection: Connection, clutch_id: str, *, of_fits: bool = False) -> Evidence:
    """What was measured of a clutch, of held runs too; without a reader of its runs. `of_fits`: nothing but fits."""
    return Evidence(
        levels=records.levels(connection, clutch_id),
        receipts={} if of_fits else records.receipts(connection, clutch_id),
        engagements={} if of_fits else _engagements(connection, clutch_id),
    )


def evidence_for(database: Database, state: ClutchState, reader: RunReader) -> Evidence | None:
    """What a clutch's summary follows from beside its tracks; None where these are enough."""
    if not needs_evidence(state):
        return None
    with database.reading() as connection:
        return replace(evidence(connection, state.clutch_id), reader=reader)


def tracked_again(database: Database, state: ClutchState, levels: Levels, receipts: Mapping[str, Receipt]) -> Results:
    """Results of a clutch whose state has changed while its runs are unchanged."""
    reader = run_reader(database, state.clutch_id)
    final, computed = computed_again(state, levels, receipts, reader, evaluated=stationary_tests_of(state.events))
    evidence = evidence_for(database, final, reader)
    return replace(computed, summary=summarised(final, computed.tracking or Tracking(), evidence))


def engagements(connection: Connection, clutch_id: str) -> list[dict[str, Any]]:
    """The accepted engagements of a clutch with all indicators, by life and cycles."""
    stored = _engagements(connection, clutch_id)
    return engagement_rows(records.events(connection, clutch_id), stored) if stored else []


def _engagements(connection: Connection, clutch_id: str) -> dict[str, StoredEngagement]:
    rows = [row for kind in DUTY_KINDS for row in runs.page(connection, clutch_id, kind=kind)]
    stored = {row.run_id: stored_engagement(row.receipt | {"cycles": whole(row.cycles)}, row.details) for row in rows}
    return {run_id: engagement for run_id, engagement in stored.items() if engagement is not None}


def run(connection: Connection, clutch_id: str, run_id: str) -> RunRow:
    """The run of a known clutch, or NotFoundError."""
    records.clutch(connection, clutch_id)
    row = runs.get(connection, clutch_id, run_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no run {run_id!r}")
    return row


def run_reader(database: Database, clutch_id: str, *, damaged: bool = False) -> RunReader:
    """The clutch's stored runs, each read in a transaction of its own when it is asked for: none stays open meanwhile."""

    def read(run_id: str, *, whole: bool = True) -> IncomingRun:
        with database.reading() as connection:
            if damaged:
                allow_damage(connection)
            row = run(connection, clutch_id, run_id)
            columns = channels.stored_of_run(connection, row.run_key) if whole else ()
        return decoded(row, columns)

    with database.reading() as connection:
        if damaged:
            allow_damage(connection)
        record = records.record(records.clutch(connection, clutch_id))
        sampled = channels.samples(connection, clutch_id)
        names = runs.keys(connection, clutch_id)
    return RunReader(
        read=read,
        describe=partial(read, whole=False),
        sampled=frozenset(run_id for run_id, run_key in names.items() if run_key in sampled),
        torque_filter=record.torque_filter,
    )


def placed(database: Database, columns: channels.Encoded) -> channels.Encoded:
    """The long columns of a run put into the store of raw records, where one is in use: before the row that names them."""
    with database.reading() as connection:
        store = raw_stores.in_use(connection)
    return columns if store is None else columns.put(store)


def _loaded_reader(database: Database, record: ClutchIn, rows: Sequence[RunRow]) -> RunReader:
    """A reader of runs whose stored channels are all in memory, so that it needs no database."""
    loaded = {}
    for row in rows:
        with database.reading() as connection:
            columns = channels.stored_of_run(connection, row.run_key)
        loaded[row.run_id] = tuple(column.loaded() for column in columns)
    by_name = {row.run_id: row for row in rows}
    return RunReader(
        read=partial(_read_loaded, by_name, loaded),
        describe=partial(_read_loaded, by_name, {}),
        sampled=frozenset(run_id for run_id, own in loaded.items() if any(column.name == "time_s" for column in own)),
        torque_filter=record.torque_filter,
    )


def _read_loaded(
    rows: Mapping[str, RunRow], loaded: Mapping[str, tuple[channels.Stored, ...]], run_id: str
) -> IncomingRun:
    """A run with the channels that are loaded of it; a function of the module, which can be pickled."""
    return decoded(rows[run_id], loaded.get(run_id, ()))


def decoded(row: RunRow, columns: Sequence[channels.Stored]) -> IncomingRun:
    """A run with its channels. Raises DamagedData, naming the run."""
    try:
        return incoming(row, channels.values_of(columns))
    except DamagedData as error:
        raise DamagedData(f"run {row.run_id} is damaged: {error}") from error


def content_now(row: RunRow, sent: IncomingRun) -> str:
    """The hash of what is stored of a run, to be compared with the one that its sender was given."""
    sha256 = content_hash(replace(sent, cycles=row.cycles if row.sent_cycles is None else row.sent_cycles))
    read_again = row.details.get("file", {}).get("content_sha256")
    return row.content_sha256 if sha256 == read_again else sha256


def _refuse_changed(database: Database, row: RunRow) -> None:
    """Raise DamagedData where what is stored of a run is not what was sent."""
    with database.reading() as connection:
        columns = channels.stored_of_run(connection, row.run_key)
    try:
        sha256 = content_now(row, decoded(row, columns))
    except KeyError as error:
        raise DamagedData(f"run {row.run_id} is damaged: its details lack {error}") from error
    if sha256 != row.content_sha256:
        raise DamagedData(f"run {row.run_id} differs from what was sent: restore a backup")


def incoming(row: RunRow, columns: Mapping[str, NDArray[np.float64]]) -> IncomingRun:
    return IncomingRun(
        kind=row.kind,
        cycles=row.cycles,
        run_id=row.run_id,
        content_sha256=row.content_sha256,
        started_at=row.started_at,
        origin=row.details["origin"],
        channels=columns,
        details={name: row.details[name] for name in ("duty", "event", "reason", "note") if name in row.details},
        file=row.details.get("file"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """All that a clutch's results are computed from: its state, its runs in the order of their arrival, those that are none
    of the history, and their channels. Picklable where it was loaded whole."""

    state: ClutchState
    rows: tuple[RunRow, ...]
    aside: Mapping[str, Event]
    reader: RunReader


def recorded(database: Database, state: ClutchState, *, whole: bool = False, damaged: bool = False) -> Recorded:
    """The clutch's runs as they are stored; `whole` with all channels in memory, else each is read when it is needed.
    `damaged`: what follows from what was sent may be damaged. Raises DamagedData where what was sent is."""
    with database.reading() as connection:
        if damaged:
            allow_damage(connection)
        rows, aside = runs.page(connection, state.clutch_id), records.set_aside(connection, state.clutch_id)
    if damaged:
        for row in rows:
            _refuse_changed(database, row)
    reader = (
        _loaded_reader(database, state.record, rows)
        if whole
        else run_reader(database, state.clutch_id, damaged=damaged)
    )
    reader = replace(reader, torque_filter=state.record.torque_filter)
    return Recorded(state=state, rows=tuple(rows), aside=aside, reader=reader)


def recomputed(recorded: Recorded) -> Results:
    """Every run of a clutch analysed again, under the state's record, and all that follows.

    Raises InvalidError where this code refuses a run that is stored, DamagedData where its channels are damaged.
    """
    state, rows, aside, reader = recorded.state, recorded.rows, recorded.aside, recorded.reader
    details, receipts, levels = {}, {}, {}
    measured: dict[str, dict[str, Any]] = {}
    for row in rows:
        sent = reader.read(row.run_id)
        try:
            analysis = analyse(sent, state.geometry, state.record.torque_filter)
        except InvalidError as error:
            raise InvalidError(f"run {row.run_id!r} is refused: {error}", errors=error.errors) from error
        measured[row.run_id] = {"speed_range": analysis.speed_range, "oil_temperature": analysis.oil_temperature}
        shown, _ = doubts_alone(sent, analysis, state.geometry)
        details[row.run_id] = analysis.details_to_store(sent) | ({} if shown is None else {"shown": shown.to_list()})
        receipts[row.run_id] = receipt(row.clutch_id, incoming(row, {}), analysis, received_at=row.received_at)
        levels[row.run_id] = analysis.fits
    events = order([replace(event, **measured[event.run_id]) for event in state.events])
    held = tuple(replace(event, **measured[event.run_id]) for event in state.held)
    state = replace(state, events=events, held=held)
    final, computed = computed_again(state, levels, receipts, reader, evaluated={})
    set_aside = [replace(event, **measured[run_id]) for run_id, event in aside.items()]
    computed = with_set_aside(computed, final, set_aside, levels, receipts, reader)
    receipts |= computed.receipts
    engagements = {row.run_id: stored_engagement(receipts[row.run_id], details[row.run_id]) for row in rows}
    evidence = Evidence(
        levels=levels,
        receipts=receipts,
        engagements={run_id: engagement for run_id, engagement in engagements.items() if engagement is not None},
        reader=reader,
    )
    summary = summarised(final, computed.tracking or Tracking(), evidence)
    return replace(computed, details=details, receipts=receipts, levels=levels, summary=summary)


def mend(database: Database, clutch_id: str, damage: DamagedData) -> None:
    """Compute all results of a clutch again from its runs, in place of those of which some are damaged.

    Raises DamagedData where what was sent is damaged too, InvalidError as `recomputed` does.
    """
    _log.warning("%s: all results of clutch %s are computed again from its runs", damage, clutch_id)
    for _ in records.attempts(clutch_id):
        with database.reading() as connection:
            state = records.state(connection, clutch_id, damaged=True)
        computed = recomputed(recorded(database, state, damaged=True))
        if records.replace_results(database, state, computed, damaged=True):
            return
