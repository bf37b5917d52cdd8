"""Inspections of a clutch by cycles, and the photographs that show what was found.

A photograph is stored once, named by the SHA-256 of its bytes, whichever inspections show it. Nothing is deleted: an
inspection that was withdrawn stays stored with its photographs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, bindparam, select, tuple_, update

from storage.dialects import ALL_ROWS, among
from storage.encoding import Json, Rows, to_text
from storage.runs import ACCEPTED
from storage.tables import inspection, inspection_photograph, photograph


@dataclass(frozen=True, slots=True, kw_only=True)
class NewInspection:
    """An inspection that is about to be stored: `cycles` since new, `content` as it was posted and its hash."""

    clutch_id: str
    inspection_id: str
    cycles: float
    content: Json
    content_sha256: str
    received_at: str
    received_by: str
    state: str = ACCEPTED


@dataclass(frozen=True, slots=True, kw_only=True)
class InspectionRow(NewInspection):
    """A stored inspection; `inspection_key` is what the rows of its photographs refer to."""

    inspection_key: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotographRow:
    """What is known of a stored photograph but its content: its hash, media type, length [bytes], and when and from whom
    the inspection got it."""

    sha256: str
    media_type: str
    bytes: int
    received_at: str
    received_by: str


_new, _rows = Rows(NewInspection), Rows(InspectionRow)
_shown = Rows(PhotographRow)
_insert = sa.insert(inspection)
_insert_photograph = sa.insert(photograph)
_attach = sa.insert(inspection_photograph)
_of_clutch = inspection.c.clutch_id == bindparam("of_clutch")
_by_id = select(inspection).where(_of_clutch, inspection.c.inspection_id == bindparam("wanted"))
_in_order = (
    select(inspection)
    .where(_of_clutch)
    .order_by(inspection.c.cycles, inspection.c.inspection_id)
    .limit(bindparam("most"))
)
_after = tuple_(inspection.c.cycles, inspection.c.inspection_id) > tuple_(bindparam("at"), bindparam("after_id"))
_set_state = update(inspection).where(inspection.c.inspection_key == bindparam("wanted"))
_photographs = (
    select(
        inspection_photograph.c.inspection_key,
        photograph.c.sha256,
        photograph.c.media_type,
        photograph.c.bytes,
        inspection_photograph.c.received_at,
        inspection_photograph.c.received_by,
    )
    .join(photograph, photograph.c.sha256 == inspection_photograph.c.sha256)
    .where(among(inspection_photograph.c.inspection_key, "of_keys"))
    .order_by(inspection_photograph.c.inspection_key, inspection_photograph.c.position)
)
_stored = select(photograph.c.sha256).where(photograph.c.sha256 == bindparam("wanted"))
_data = (
    select(photograph.c.data)
    .join(inspection_photograph, inspection_photograph.c.sha256 == photograph.c.sha256)
    .where(inspection_photograph.c.inspection_key == bindparam("of_key"), photograph.c.sha256 == bindparam("wanted"))
)


def insert(connection: Connection, row: NewInspection) -> int:
    """Store a new inspection and return its key. Raises IntegrityError where the clutch is unknown or has this id."""
    inspection_key: int = next(iter(connection.execute(_insert, _new.values(row)).inserted_primary_key or ()))
    return inspection_key


def get(connection: Connection, clutch_id: str, inspection_id: str) -> InspectionRow | None:
    return _rows.first(connection.execute(_by_id, {"of_clutch": clutch_id, "wanted": inspection_id}))


def page(
    connection: Connection, clutch_id: str, *, limit: int | None = None, after: tuple[float, str] | None = None
) -> list[InspectionRow]:
    """Inspections of a clutch by cycles, at most `limit`, behind `after`, the (cycles, inspection_id) of another."""
    values: dict[str, object] = {"of_clutch": clutch_id, "most": ALL_ROWS if limit is None else limit}
    query = _in_order
    if after is not None:
        query, values = query.where(_after), values | {"at": after[0], "after_id": after[1]}
    return _rows.all(connection.execute(query, values))


def set_state(connection: Connection, inspection_key: int, state: str) -> None:
    """Withdraw an inspection or take that back. Raises LookupError on an unknown one."""
    if connection.execute(_set_state, {"wanted": inspection_key, "state": state}).rowcount != 1:
        raise LookupError(f"inspection {inspection_key} is not stored")


def photographs(connection: Connection, inspection_keys: Sequence[int]) -> dict[int, list[PhotographRow]]:
    """inspection_key -> the photographs of those inspections in the order in which they came, without their content."""
    of_keys: dict[int, list[PhotographRow]] = {key: [] for key in inspection_keys}
    rows = connection.execute(_photographs, {"of_keys": to_text(list(inspection_keys))})
    of = _shown.reader(rows)
    for row in rows:
        of_keys[row.inspection_key].append(of(row))
    return of_keys


def data(connection: Connection, inspection_key: int, sha256: str) -> bytes | None:
    """The content of a photograph of that inspection, None where it has no such one."""
    content: bytes | None = connection.execute(_data, {"of_key": inspection_key, "wanted": sha256}).scalar()
    return content


def attach(connection: Connection, inspection_key: int, row: PhotographRow, content: bytes, *, position: int) -> None:
    """Add a photograph to an inspection; its content is stored where it is not there yet. Raises IntegrityError where the
    inspection has it already."""
    if connection.execute(_stored, {"wanted": row.sha256}).first() is None:
        stored = {"sha256": row.sha256, "media_type": row.media_type, "bytes": row.bytes, "data": content}
        connection.execute(_insert_photograph, stored)
    attached = {"received_at": row.received_at, "received_by": row.received_by, "position": position}
    connection.execute(_attach, attached | {"inspection_key": inspection_key, "sha256": row.sha256})
