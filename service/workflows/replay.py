"""Recompute results from the raw runs, which are never changed."""

from typing import Any

from sqlalchemy import Connection

from service import records
from service.lives.assumptions import ALL_PRESSURES
from service.lives.incoming_run import IncomingRun
from service.lives.loop_analysis import refresh_loops
from service.lives.receipt import fit_receipt, receipt
from service.lives.run_analysis import NOTICED_ON_ARRIVAL, Analysis, Warned, analyse
from service.lives.surprise import OFF_TRACK
from service.lives.tracks import CARRIED
from service.settings import CODE_VERSION
from service.workflows.adopt_model import retrack_all
from storage import channels, clutches, fits, predictions, runs
from storage.engine.database import Database
from storage.runs import RunRow


def clutch_ids(database: Database) -> list[str]:
    """All clutches."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def replay_clutch(database: Database, clutch_id: str) -> int:
    """Fit and track all runs of a clutch anew, in one transaction; returns how many. Raises NotFoundError.

    The revision moves on only where a result has changed.
    """
    with database.writing() as connection:
        clutch = records.clutch(connection, clutch_id)
        geometry = records.record(clutch).geometry.to_model()
        before = results(connection, clutch_id)
        rows = records.run_rows(connection, clutch_id)
        for row in rows:
            incoming = records.incoming(row, channels.read(connection, row.run_key))
            analysis = analyse(incoming, geometry)
            fits.write(connection, row.run_key, records.fit_rows(analysis.fits, {}))
            answer = _receipt(row, incoming, analysis)
            runs.set_results(connection, row.run_key, records.details(incoming, analysis), answer, CODE_VERSION)
        events = retrack_all(connection, clutch)
        refresh_loops(connection, clutch_id, events, geometry)
        if results(connection, clutch_id) != before:
            clutches.bump_revision(connection, clutch_id)
        return len(rows)


def results(connection: Connection, clutch_id: str) -> list[Any]:
    """All that is said of a clutch."""
    said = [predictions.history(connection, clutch_id, method, ALL_PRESSURES) for method in CARRIED]
    return [[row.receipt for row in records.run_rows(connection, clutch_id)], said]


def _receipt(row: RunRow, incoming: IncomingRun, analysis: Analysis) -> dict[str, Any]:
    """The receipt anew, its mean COFs yet to come; what was noticed when the run arrived is known from the old one alone."""
    kept = [Warned(**each) for each in row.receipt["warnings"] if each["code"] in (*NOTICED_ON_ARRIVAL, OFF_TRACK)]
    return receipt(
        row.clutch_id,
        incoming,
        received_at=row.received_at,
        fits=[fit_receipt(level.fit, None) for level in analysis.fits],
        warnings=[*analysis.warnings, *kept],
    )
