"""Clutches: registered, looked up, listed worst first."""

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from sqlalchemy import Connection

from service import records
from service.errors import ConflictError
from service.lives.adopted_model import BASELINE
from service.schemas.clutch import ClutchIn
from service.workflows.adopt_model import present_life
from service.workflows.update_tracks import RANK_UNKNOWN, SUMMARY
from storage import clutches, verdicts
from storage.clutches import ClutchRow
from storage.engine.database import Database
from storage.verdicts import VerdictRow


def register(database: Database, clutch: ClutchIn, *, created_at: str) -> tuple[dict[str, Any], bool]:
    """Register a clutch; returns it and whether it is new. Raises ConflictError where it is known with other content."""
    record = clutch.model_dump(mode="json")
    content = _content(record)
    with database.reading() as connection:
        known = clutches.get(connection, clutch.clutch_id)
        if known is not None:
            return _known(connection, known, content), False
    with database.writing() as connection:
        known = clutches.get(connection, clutch.clutch_id)
        if known is not None:
            return _known(connection, known, content), False
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


def _content(record: dict[str, Any]) -> str:
    """A record's hash, with the defaults of fields that came after it filled in."""
    return hashlib.sha256(json.dumps(record, sort_keys=True).encode()).hexdigest()


def _known(connection: Connection, row: ClutchRow, content: str) -> dict[str, Any]:
    if _content(records.record(row).model_dump(mode="json")) != content:
        raise ConflictError(
            f"clutch {row.clutch_id!r} is known with another record; records are not changed by posting"
        )
    return _described(connection, [row])[0]


def look_up(database: Database, clutch_id: str) -> dict[str, Any]:
    """A clutch; raises NotFoundError."""
    with database.reading() as connection:
        return _described(connection, [records.clutch(connection, clutch_id)])[0]


def page(
    database: Database, *, limit: int, after: tuple[float, str] | None
) -> tuple[list[dict[str, Any]], tuple[float, str] | None]:
    """Clutches with the fewest remaining cycles first, and where the next page starts."""
    with database.reading() as connection:
        rows = clutches.page(connection, limit=limit + 1, after=after)
        items = _described(connection, rows[:limit])
    more = (rows[limit - 1].rank, rows[limit - 1].clutch_id) if len(rows) > limit else None
    return items, more


def _described(connection: Connection, rows: Sequence[ClutchRow]) -> list[dict[str, Any]]:
    """Clutches as they go out."""
    said = verdicts.newest(connection, [row.clutch_id for row in rows])
    return [describe(row, _latest(connection, row, said.get(row.clutch_id))) for row in rows]


def _latest(connection: Connection, row: ClutchRow, verdict: VerdictRow | None) -> dict[str, Any] | None:
    """The newest finished diagnosis as it goes out; what it says of a life that a rebuild has ended is past."""
    if verdict is None:
        return None
    life = row.summary.get("life")  # what was stored by earlier releases does not say it
    earlier = verdict.life != (present_life(connection, row.clutch_id) if life is None else life)
    return {
        "diagnosis_id": verdict.diagnosis_id,
        "verdict": verdict.verdict,
        "causes": list(verdict.causes),
        "adopted": verdict.adopted and not earlier,
        "earlier_life": earlier,
    }


#: What summaries did not say that were stored before models could be adopted.
_BEFORE = {"model": dict(BASELINE)}


def describe(row: ClutchRow, diagnosis: dict[str, Any] | None = None) -> dict[str, Any]:
    """A clutch as it goes out."""
    return records.record(row).model_dump(mode="json") | {
        "created_at": row.created_at,
        "revision": row.revision,
        "runs": row.summary.get("runs", 0),
        "summary": {name: (_BEFORE | row.summary)[name] for name in SUMMARY} if row.summary else None,
        "recent": row.summary.get("recent"),
        "diagnosis": diagnosis,
    }
