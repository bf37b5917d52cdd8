"""Results are recomputed from the raw runs, which are never changed."""

from service import records, stored_runs
from service.background import AtOnce, directly
from service.errors import BusyError
from service.lives.criteria import MOST_ATTEMPTS
from service.lives.recomputation import ClutchState
from storage import clutches
from storage.engine.database import Database


def clutch_ids(database: Database) -> list[str]:
    """All clutches."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def replay_clutch(database: Database, clutch_id: str, at_once: AtOnce = directly) -> int:
    """Fit and track all runs of a clutch anew; returns how many. Raises NotFoundError, and BusyError where runs came at each
    of MOST_ATTEMPTS.

    The revision moves on only where a result has changed. Stored by `at_once`.
    """
    for _ in range(MOST_ATTEMPTS):
        with database.reading() as connection:
            state = records.state(connection, clutch_id)
        replayed = stored_runs.recomputed(database, state)
        if at_once(_replaced, database, state, replayed):
            return len(replayed.receipts)
    raise BusyError(
        f"left as it was: runs came each of the {MOST_ATTEMPTS} times that it was computed anew; replay it when fewer come"
    )


def _replaced(database: Database, state: ClutchState, replayed: stored_runs.Recomputed) -> bool:
    """Store a clutch's results where its revision still is that of the state they follow from; whether it was."""
    clutch_id = state.clutch_id
    with database.writing() as connection:
        unchanged = records.unchanged(connection, clutch_id, state.revision)
        if unchanged:
            before = records.answers(connection, clutch_id)
            stored_runs.store_recomputed(connection, clutch_id, replayed)
            if records.answers(connection, clutch_id) != before:
                clutches.bump_revision(connection, clutch_id)
    return unchanged
