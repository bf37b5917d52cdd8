"""Clutches: registered, looked up, listed worst first."""

import hashlib
import json
from typing import Any

from service.errors import ConflictError
from service.schemas.clutch import ClutchIn
from service.workflows import stored
from service.workflows.retrack import RANK_UNKNOWN, SUMMARY
from storage import clutches
from storage.clutches import ClutchRow
from storage.database import Database


def register(database: Database, clutch: ClutchIn, *, created_at: str) -> tuple[dict[str, Any], bool]:
    """Register a clutch; returns it and whether it is new. Raises ConflictError where it is known with other content."""
    record = clutch.model_dump(mode="json")
    content = hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()
    with database.reading() as connection:
        known = clutches.get(connection, clutch.clutch_id)
        if known is not None:
            return _known(known, content), False
    with database.writing() as connection:
        known = clutches.get(connection, clutch.clutch_id)
        if known is not None:
            return _known(known, content), False
        row = ClutchRow(
            clutch_id=clutch.clutch_id,
            record=record,
            content_sha256=content,
            created_at=created_at,
            revision=0,
            rank=RANK_UNKNOWN,
            summary={},
        )
        clutches.insert(connection, row)
        return describe(row), True


def _known(row: ClutchRow, content: str) -> dict[str, Any]:
    if row.content_sha256 != content:
        raise ConflictError(
            f"clutch {row.clutch_id!r} is known with another record; records are not changed by posting"
        )
    return describe(row)


def look_up(database: Database, clutch_id: str) -> dict[str, Any]:
    """A clutch; raises NotFoundError."""
    with database.reading() as connection:
        return describe(stored.clutch(connection, clutch_id))


def page(
    database: Database, *, limit: int, after: tuple[float, str] | None
) -> tuple[list[dict[str, Any]], tuple[float, str] | None]:
    """Clutches with the fewest remaining cycles first, and where the next page starts."""
    with database.reading() as connection:
        rows = clutches.page(connection, limit=limit + 1, after=after)
        items = [describe(row) for row in rows[:limit]]
    more = (rows[limit - 1].rank, rows[limit - 1].clutch_id) if len(rows) > limit else None
    return items, more


def describe(row: ClutchRow) -> dict[str, Any]:
    """A clutch as it goes out."""
    return dict(row.record) | {
        "created_at": row.created_at,
        "revision": row.revision,
        "runs": row.summary.get("runs", 0),
        "summary": {name: row.summary[name] for name in SUMMARY} if row.summary else None,
    }
