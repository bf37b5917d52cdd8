"""Results are recomputed from the raw runs, which are never changed."""

from service import records, stored_runs
from storage import clutches
from storage.engine.database import Database


def clutch_ids(database: Database) -> list[str]:
    """All clutches."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def replay_clutch(database: Database, clutch_id: str) -> int:
    """Fit and track all runs of a clutch anew; returns how many. Raises NotFoundError.

    The revision moves on only where a result has changed.
    """
    while True:
        with database.reading() as connection:
            state = records.state(connection, clutch_id)
        replayed = stored_runs.recomputed(database, state)
        with database.writing() as connection:
            if not records.unchanged(connection, clutch_id, state.revision):
                continue
            before = records.answers(connection, clutch_id)
            stored_runs.store_recomputed(connection, clutch_id, replayed)
            if records.answers(connection, clutch_id) != before:
                clutches.bump_revision(connection, clutch_id)
            return len(replayed.receipts)
