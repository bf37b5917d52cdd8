"""The table of the audit trail: who changed what, when and why. Rows are added, never changed."""

from dataclasses import dataclass

from sqlalchemy import Connection, func, select

from storage.dialects import newest_first
from storage.encoding import Json, to_text
from storage.rows import Rows, sealed
from storage.tables import change

HOLD, CONFIRM, WITHDRAW, RESTORE, CORRECT = "hold", "confirm", "withdraw", "restore", "correct"
REREAD = "reread"
#: What the evidence of other runs does: a held run is accepted, an accepted one held.
ACCEPT, DOUBT = "accept", "doubt"
EDIT, ARCHIVE, UNARCHIVE, ADOPT = "edit", "archive", "unarchive", "adopt"
WITHDRAW_INSPECTION, RESTORE_INSPECTION = "withdraw_inspection", "restore_inspection"
#: What changes a clutch's history, and with it what a diagnosis was made of.
OF_HISTORY = (ACCEPT, DOUBT, CONFIRM, WITHDRAW, RESTORE, CORRECT, REREAD, EDIT)
#: What the trail shows of a change.
SHOWN = ("at", "by", "action", "run_id", "reason", "before", "after")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeRow:
    """An entry of the audit trail: `run_id` None if it is about the clutch; `revision`: the clutch's after it; later
    entries have greater keys."""

    change_key: int
    clutch_id: str
    run_id: str | None
    at: str
    by: str
    action: str
    reason: str
    before: Json
    after: Json
    revision: int

    def entry(self) -> Json:
        return {name: getattr(self, name) for name in SHOWN}


_rows = Rows(ChangeRow, of=change)


def insert(
    connection: Connection,
    clutch_id: str,
    action: str,
    before: Json,
    after: Json,
    *,
    at: str,
    by: str,
    revision: int,
    run_id: str | None = None,
    reason: str = "",
) -> None:
    """Store a change. Raises IntegrityError where the clutch is unknown."""
    of = {"clutch_id": clutch_id, "run_id": run_id, "action": action, "at": at, "by": by, "revision": revision}
    what = {"reason": reason, "before": to_text(before), "after": to_text(after)}
    connection.execute(change.insert(), sealed(change, of | what))


def page(
    connection: Connection,
    clutch_id: str,
    *,
    run_id: str | None = None,
    limit: int | None = None,
    before: float | None = None,
) -> list[ChangeRow]:
    """Changes of a clutch and its runs, or of one run, newest first; `before`: the key of the previous page's last
    change."""
    query = newest_first(select(change), change.c.change_key, before=before, limit=limit)
    query = query.where(change.c.clutch_id == clutch_id)
    if run_id is not None:
        query = query.where(change.c.run_id == run_id)
    return _rows.all(connection.execute(query))


def newest_of_runs(connection: Connection, clutch_id: str) -> dict[str, Json]:
    """run_id -> the run's fields after its last change by the audit trail, for the runs of a clutch that were changed."""
    return {row.run_id: row.after for row in reversed(page(connection, clutch_id)) if row.run_id is not None}


def last_of_history(connection: Connection, clutch_id: str) -> int:
    """The revision of the last change that may alter the clutch's history, 0 if there was none."""
    of_history = (change.c.clutch_id == clutch_id, change.c.action.in_(OF_HISTORY))
    return connection.execute(select(func.max(change.c.revision)).where(*of_history)).scalar() or 0
