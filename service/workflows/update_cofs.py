"""Take every mean COF of a clutch anew, where another test has become the reference."""

from dataclasses import replace
from typing import Any

from sqlalchemy import Connection

from models.clutch import Geometry
from service import records
from service.lives.history import ByPressure, Event, lives, order, reference_velocities
from service.lives.receipt import fit_receipt
from service.lives.run_analysis import mean_cofs
from storage import fits, runs


def refresh_cofs(connection: Connection, clutch_id: str, geometry: Geometry) -> list[Event]:
    """Mean COF of every test over the protocol of its life's first test, stored beside the fits and in the receipts.

    Returns the history, ordered.
    """
    rows = {row.run_id: row for row in records.run_rows(connection, clutch_id)}
    levels = records.levels(connection, clutch_id)
    refreshed = []
    for life in lives(order([records.event(row, {}) for row in runs.in_order(connection, clutch_id)])):
        for event in life.events:
            found = levels.get(event.run_id, [])
            cofs: ByPressure = {}
            if found:
                row = rows[event.run_id]
                if life.speed_range is not None:
                    cofs = mean_cofs(found, reference_velocities(life.speed_range, geometry), geometry)
                fits.write(connection, row.run_key, records.fit_rows(found, cofs))
                answer: dict[str, Any] = row.receipt | {
                    "fits": [fit_receipt(level.fit, cofs.get(level.fit.pressure)) for level in found]
                }
                runs.set_results(connection, row.run_key, row.details, answer, row.code_version)
            refreshed.append(replace(event, cofs=cofs))
    return refreshed
