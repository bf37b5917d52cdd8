"""`/runs` and `/loops`: receipts by cycles, and the friction loops of the dynamic tests."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from service import records
from service.columns import whole
from service.lives.history import DYNAMIC
from storage import runs
from storage.engine.database import Database

Place = tuple[float, str]
COLUMNS = ("run_id", "kind", "cycles", "started_at", "received_at", "origin", "content_sha256", "warnings", "fits")


def page(
    database: Database, clutch_id: str, *, limit: int, after: Place | None
) -> tuple[list[dict[str, Any]], Place | None]:
    """Receipts by cycles, and where the next page starts. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, limit=limit + 1, after=after)
    receipts = [row.receipt for row in rows[:limit]]
    return receipts, (rows[limit - 1].cycles, rows[limit - 1].run_id) if len(rows) > limit else None


def rows(items: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Receipts as rows of a table; warnings and fits are counted."""
    for item in items:
        yield {name: item[name] for name in COLUMNS} | {
            "warnings": len(item["warnings"]),
            "fits": len(item["fits"]),
        }


def loops(database: Database, clutch_id: str) -> list[dict[str, Any]]:
    """Friction loops by cycles and pressure. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, kind=DYNAMIC)
    return [{"run_id": row.run_id, "cycles": whole(row.cycles)} | loop for row in rows for loop in row.receipt["loops"]]
