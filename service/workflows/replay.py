"""Recompute results from the raw runs, which are never changed."""

from typing import Any

from sqlalchemy import Connection

from models.clutch import Geometry
from service.formats.incoming import IncomingRun
from service.settings import CODE_VERSION
from service.workflows import stored
from service.workflows.analysis import LATE, Analysis, Warned, analyse
from service.workflows.history import ByPressure, Event, lives, order, reference_velocities
from service.workflows.receipts import fit_receipt, mean_cofs, receipt
from service.workflows.retrack import retrack
from storage import channels, clutches, fits, runs
from storage.database import Database
from storage.runs import RunRow


def clutch_ids(database: Database) -> list[str]:
    """All clutches."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def replay_clutch(database: Database, clutch_id: str) -> int:
    """Fit and track all runs of a clutch anew, in one transaction; returns how many. Raises NotFoundError."""
    with database.writing() as connection:
        clutch = stored.clutch(connection, clutch_id)
        geometry = stored.record(clutch).geometry.to_model()
        rows = stored.run_rows(connection, clutch_id)
        analysed = {}
        for row in rows:
            incoming = stored.incoming(row, channels.read(connection, row.run_key))
            analysed[row.run_id] = row, incoming, analyse(incoming, geometry)
            _store_fits(connection, row, incoming, analysed[row.run_id][2])
        events = refresh_cofs(connection, clutch_id, geometry)
        for event in events:
            row, incoming, analysis = analysed[event.run_id]
            answer = _receipt(row, incoming, analysis, event.cofs)
            runs.set_results(connection, row.run_key, stored.details(incoming, analysis), answer, CODE_VERSION)
        clutches.bump_revision(connection, clutch_id)
        retrack(connection, clutch, events)
        return len(rows)


def _store_fits(connection: Connection, row: RunRow, incoming: IncomingRun, analysis: Analysis) -> None:
    fits.write(connection, row.run_key, stored.fit_rows(analysis.fits, {}))
    runs.set_results(connection, row.run_key, stored.details(incoming, analysis), row.receipt, CODE_VERSION)


def refresh_cofs(connection: Connection, clutch_id: str, geometry: Geometry) -> list[Event]:
    """Take every test's mean COF anew over the protocol of its life's first test, store it, and return the history."""
    rows = {row.run_id: row for row in runs.in_order(connection, clutch_id)}
    levels = stored.levels(connection, clutch_id)
    refreshed = []
    for life in lives(order([stored.event(row, {}) for row in rows.values()])):
        for event in life.events:
            row = rows[event.run_id]
            cofs: ByPressure = {}
            if life.speed_range is not None and row.run_id in levels:
                velocities = reference_velocities(life.speed_range, geometry)
                cofs = mean_cofs(levels[row.run_id], velocities, geometry)
                fits.write(connection, row.run_key, stored.fit_rows(levels[row.run_id], cofs))
            refreshed.append(stored.event(row, cofs))
    return refreshed


def _receipt(row: RunRow, incoming: IncomingRun, analysis: Analysis, cofs: ByPressure) -> dict[str, Any]:
    """The receipt anew; whether the run had come late is known from the old one alone."""
    kept = [Warned(**each) for each in row.receipt["warnings"] if each["code"] == LATE]
    return receipt(
        row.clutch_id,
        incoming,
        received_at=row.received_at,
        fits=[fit_receipt(level.fit, cofs.get(level.fit.pressure)) for level in analysis.fits],
        warnings=[*analysis.warnings, *kept],
    )
