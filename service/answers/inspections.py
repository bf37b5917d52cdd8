"""`/inspections`: what was found on a clutch's friction surface, by cycles, and the files of its photographs."""

from collections.abc import Iterator, Mapping
from typing import Any

from service import repository
from service.errors import NotFoundError
from service.paging import Part, by_cycles
from service.repository import inspection, inspection_answers
from storage import inspections
from storage.engine.database import Database

COLUMNS = (
    "inspection_id", "cycles", "performed_at", "lining", "roughness_um", "skewness", "note", "origin", "received_at",
    "received_by", "state", "photographs",
)  # fmt: skip


def page(database: Database, clutch_id: str, part: Part) -> dict[str, Any]:
    """Inspections by cycles. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = inspections.page(connection, clutch_id, limit=part.most, after=part.after)
        items = {item["inspection_id"]: item for item in inspection_answers(connection, rows)}
    return part.of(rows, by_cycles("inspection_id"), lambda row: items[row.inspection_id])


def rows(payload: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for item in payload["items"]:
        yield {name: item[name] for name in COLUMNS} | {"photographs": len(item["photographs"])}


def look_up(database: Database, clutch_id: str, inspection_id: str) -> dict[str, Any]:
    """One inspection. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        return inspection_answers(connection, [inspection(connection, clutch_id, inspection_id)])[0]


def media_type(database: Database, clutch_id: str, inspection_id: str, photograph_id: str) -> str:
    """The type of a photograph's file; its content is not read. Raises NotFoundError."""
    with database.reading() as connection:
        key = inspection(connection, clutch_id, inspection_id).inspection_key
        for photograph in inspections.photographs(connection, [key])[key]:
            if photograph.sha256 == photograph_id:
                return photograph.media_type
    raise NotFoundError(f"inspection {inspection_id!r} has no photograph {photograph_id!r}")


def photograph(database: Database, clutch_id: str, inspection_id: str, photograph_id: str) -> bytes:
    """The file of a photograph. Raises NotFoundError."""
    with database.reading() as connection:
        key = inspection(connection, clutch_id, inspection_id).inspection_key
        content = inspections.data(connection, key, photograph_id)
    if content is None:
        raise NotFoundError(f"inspection {inspection_id!r} has no photograph {photograph_id!r}")
    return content
