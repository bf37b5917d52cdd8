"""Stored inspections as they are answered, with their photographs."""

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import Connection

from service.errors import NotFoundError
from service.identity import content_of, instant
from storage import inspections
from storage.inspections import InspectionRow, PhotographRow


def inspection(connection: Connection, clutch_id: str, inspection_id: str) -> InspectionRow:
    """The inspection, or NotFoundError."""
    row = inspections.get(connection, clutch_id, inspection_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no inspection {inspection_id!r}")
    return row


def content_hash(content: Mapping[str, Any]) -> str:
    """The sha256 of what an inspection states."""
    return content_of({**content, "performed_at": instant(content["performed_at"])})


def answers(connection: Connection, rows: Sequence[InspectionRow]) -> list[dict[str, Any]]:
    """Inspections as they are answered."""
    photographs = inspections.photographs(connection, [row.inspection_key for row in rows])
    return [
        {"clutch_id": row.clutch_id, "inspection_id": row.inspection_id}
        | row.content
        | {
            "content_sha256": row.content_sha256,
            "received_at": row.received_at,
            "received_by": row.received_by,
            "state": row.state,
            "duplicate": False,
            "photographs": [photograph_answer(photograph) for photograph in photographs[row.inspection_key]],
        }
        for row in rows
    ]


def photograph_answer(row: PhotographRow) -> dict[str, Any]:
    """A photograph as it is answered."""
    return {
        "photograph_id": row.sha256,
        "media_type": row.media_type,
        "bytes": row.bytes,
        "received_at": row.received_at,
        "received_by": row.received_by,
    }
