"""Results are recomputed from the raw runs, which are never changed."""

from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import Connection

from service import records, stored_runs
from service.lives.history import order
from service.lives.incoming_run import IncomingRun
from service.lives.payloads import OFF_TRACK, receipt
from service.lives.recomputation import Results, computed_anew, loops_anew
from service.lives.run_analysis import NOTICED_ON_ARRIVAL, Analysis, Notice, analyse
from service.settings import CODE_VERSION
from storage import clutches, results, runs
from storage.engine.database import Database
from storage.runs import RunRow


@dataclass(frozen=True, slots=True, kw_only=True)
class _Replayed:
    """Everything of a clutch at a revision, computed anew: what stands beside each run's channels, and the results."""

    revision: int
    details: dict[str, dict[str, Any]]
    receipts: dict[str, dict[str, Any]]
    results: Results


def clutch_ids(database: Database) -> list[str]:
    """All clutches."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def replay_clutch(database: Database, clutch_id: str) -> int:
    """Fit and track all runs of a clutch anew; returns how many. Raises NotFoundError.

    The revision moves on only where a result has changed.
    """
    while True:
        replayed = _computed(database, clutch_id)
        with database.writing() as connection:
            if records.unchanged(connection, clutch_id, replayed.revision):
                return _store(connection, clutch_id, replayed)


def _computed(database: Database, clutch_id: str) -> _Replayed:
    with database.reading() as connection:
        state = records.state(connection, clutch_id)
        rows = runs.page(connection, clutch_id)
    reader = stored_runs.run_reader(database, clutch_id)
    details, receipts, levels, speed_ranges = {}, {}, {}, {}
    for row in rows:
        run = reader.read(row.run_id)
        analysis = analyse(run, state.geometry)
        details[row.run_id] = records.details(run, analysis)
        receipts[row.run_id] = _receipt(row, stored_runs.incoming(row, {}), analysis)
        levels[row.run_id] = analysis.fits
        speed_ranges[row.run_id] = analysis.speed_range
    events = order([replace(event, speed_range=speed_ranges[event.run_id]) for event in state.events])
    state = replace(state, events=events)
    tests = reader.stationary_tests(state.lives[-1]) if events else iter(())
    final, results = computed_anew(state, levels, receipts, tests, reader)
    receipts |= results.receipts
    for run_id, items in loops_anew(final, levels, reader).items():
        receipts[run_id] = receipts[run_id] | {"loops": items}
    return _Replayed(
        revision=state.revision,
        details=details,
        receipts=receipts,
        results=results,
    )


def _receipt(row: RunRow, run: IncomingRun, analysis: Analysis) -> dict[str, Any]:
    """The receipt anew, its mean COFs yet to come; what was noticed when the run arrived is known from the old one alone."""
    kept = [Notice(**item) for item in row.receipt["warnings"] if item["code"] in (*NOTICED_ON_ARRIVAL, OFF_TRACK)]
    return receipt(
        row.clutch_id,
        run,
        received_at=row.received_at,
        levels=analysis.fits,
        cofs={},
        warnings=[*analysis.warnings, *kept],
    )


def _store(connection: Connection, clutch_id: str, replayed: _Replayed) -> int:
    before = records.answers(connection, clutch_id)
    rows = runs.page(connection, clutch_id)
    for row in rows:
        results.write_fits(connection, row.run_key, [])
        details, answer = replayed.details[row.run_id], replayed.receipts[row.run_id]
        runs.set_results(connection, row.run_key, details, answer, CODE_VERSION)
    records.store(connection, clutch_id, replace(replayed.results, receipts={}))
    if records.answers(connection, clutch_id) != before:
        clutches.bump_revision(connection, clutch_id)
    return len(rows)
