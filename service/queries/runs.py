"""`/runs` and `/loops`: receipts by cycles, and the friction loops of the dynamic tests."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from service import records
from service.columns import whole
from service.lives.history import DYNAMIC
from storage import changes, runs
from storage.encoding.json_text import to_text
from storage.engine.database import Database

Place = tuple[float, str]
COLUMNS = (
    "run_id", "kind", "cycles", "started_at", "received_at", "origin", "content_sha256", "warnings", "fits", "state",
    "sent_cycles",
)  # fmt: skip
TRAIL_COLUMNS = changes.SHOWN


def page(
    database: Database, clutch_id: str, *, limit: int, after: Place | None, state: str | None = None
) -> tuple[list[dict[str, Any]], Place | None]:
    """Receipts by cycles, of runs in one state or all, and where the next page starts. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, limit=limit + 1, after=after, state=state)
    receipts = [records.receipt(row) for row in rows[:limit]]
    return receipts, (rows[limit - 1].cycles, rows[limit - 1].run_id) if len(rows) > limit else None


def rows(items: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Receipts as rows of a table; warnings and fits are counted."""
    for item in items:
        yield {name: item[name] for name in COLUMNS} | {
            "warnings": len(item["warnings"]),
            "fits": len(item["fits"]),
        }


def trail(
    database: Database, clutch_id: str, *, limit: int, after: Place | None
) -> tuple[list[dict[str, Any]], Place | None]:
    """The audit trail of a clutch and its runs, newest first, and where the next page starts. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = changes.page(connection, clutch_id, limit=limit + 1, before=None if after is None else after[0])
    items = [row.entry() for row in rows[:limit]]
    return items, (float(rows[limit - 1].change_key), "") if len(rows) > limit else None


def trail_rows(items: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """The audit trail as rows of a table; what changed is JSON."""
    for item in items:
        yield {name: item[name] for name in TRAIL_COLUMNS} | {name: to_text(item[name]) for name in ("before", "after")}


def loops(database: Database, clutch_id: str) -> list[dict[str, Any]]:
    """Friction loops by cycles and pressure. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, kind=DYNAMIC, state=runs.ACCEPTED)
    return [{"run_id": row.run_id, "cycles": whole(row.cycles)} | loop for row in rows for loop in row.receipt["loops"]]
