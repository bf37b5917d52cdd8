"""What was measured of a clutch, out of the rows: curves, receipts and engagements."""

from dataclasses import replace
from typing import Any

from sqlalchemy import Connection

from service import records
from service.columns import whole
from service.lives.engagements.evaluation import DUTY_KINDS
from service.lives.engagements.over_life import StoredEngagement, stored_engagement
from service.lives.model_correction import RunReader
from service.lives.outlook import Evidence, engagement_rows, needs_evidence
from service.lives.recomputation import ClutchState
from storage import runs
from storage.engine.database import Database


def evidence(connection: Connection, clutch_id: str) -> Evidence:
    """What was measured of a clutch, of held runs too; without a reader of its runs."""
    return Evidence(
        levels=records.levels(connection, clutch_id),
        receipts=records.receipts(connection, clutch_id),
        engagements=_engagements(connection, clutch_id),
    )


def evidence_for(database: Database, state: ClutchState, reader: RunReader) -> Evidence | None:
    """What a clutch's summary follows from beside its tracks; None where these are enough."""
    if not needs_evidence(state):
        return None
    with database.reading() as connection:
        return replace(evidence(connection, state.clutch_id), reader=reader)


def engagements(connection: Connection, clutch_id: str) -> list[dict[str, Any]]:
    """The accepted engagements of a clutch with all indicators, by life and cycles."""
    stored = _engagements(connection, clutch_id)
    return engagement_rows(records.events(connection, clutch_id), stored) if stored else []


def _engagements(connection: Connection, clutch_id: str) -> dict[str, StoredEngagement]:
    rows = [row for kind in DUTY_KINDS for row in runs.page(connection, clutch_id, kind=kind)]
    stored = {row.run_id: stored_engagement(row.receipt | {"cycles": whole(row.cycles)}, row.details) for row in rows}
    return {run_id: engagement for run_id, engagement in stored.items() if engagement is not None}
