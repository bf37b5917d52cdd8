"""Inspections of a clutch by cycles, and the photographs that show what was found.

A photograph is stored once, named by the SHA-256 of its bytes, whichever inspections show it. Nothing is deleted: an
inspection that was withdrawn stays stored with its photographs.
"""

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, LargeBinary, func, literal_column, select, tuple_

from storage.dialects import among
from storage.encoding import Json
from storage.rows import Rows, amend
from storage.runs import ACCEPTED
from storage.tables import inspection, inspection_photograph, photograph


@dataclass(frozen=True, slots=True, kw_only=True)
class InspectionRow:
    """An inspection: `cycles` since new, `content` as posted, and its hash; photographs refer to its key."""

    clutch_id: str
    inspection_id: str
    cycles: float
    content: Json
    content_sha256: str
    received_at: str
    received_by: str
    state: str = ACCEPTED
    inspection_key: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotographRow:
    """A stored photograph without its content: hash, media type, length [bytes], and time and sender of its receipt."""

    sha256: str
    media_type: str
    bytes: int
    received_at: str
    received_by: str


_rows, _shown = Rows(InspectionRow, key="inspection_key", of=inspection), Rows(PhotographRow)
_photographs = (
    select(inspection_photograph.c.inspection_key, *(photograph.c[name] for name in _shown.names[:3]))
    .add_columns(inspection_photograph.c.received_at, inspection_photograph.c.received_by)
    .join(photograph, photograph.c.sha256 == inspection_photograph.c.sha256)
    .order_by(inspection_photograph.c.inspection_key, inspection_photograph.c.position)
)


def insert(connection: Connection, row: InspectionRow) -> int:
    """Store a new inspection and return its key. Raises IntegrityError where the clutch is unknown or has this id."""
    inspection_key: int = next(
        iter(connection.execute(inspection.insert(), _rows.values(row)).inserted_primary_key or ())
    )
    return inspection_key


def get(connection: Connection, clutch_id: str, inspection_id: str) -> InspectionRow | None:
    of_id = (inspection.c.clutch_id == clutch_id, inspection.c.inspection_id == inspection_id)
    return _rows.first(connection.execute(select(inspection).where(*of_id)))


def page(
    connection: Connection, clutch_id: str, *, limit: int | None = None, after: tuple[float, str] | None = None
) -> list[InspectionRow]:
    """A page of a clutch's inspections by cycles, at most `limit`, after `after`, the (cycles, inspection_id) of
    another."""
    order = (inspection.c.cycles, inspection.c.inspection_id)
    query = select(inspection).where(inspection.c.clutch_id == clutch_id).order_by(*order).limit(limit)
    if after is not None:
        query = query.where(tuple_(*order) > tuple_(*after))
    return _rows.all(connection.execute(query))


def set_state(connection: Connection, inspection_key: int, state: str) -> None:
    """Withdraw or restore an inspection. Raises LookupError on an unknown one."""
    if not amend(connection, inspection, [inspection.c.inspection_key == inspection_key], state=state):
        raise LookupError(f"inspection {inspection_key} is not stored")


def photographs(connection: Connection, inspection_keys: Sequence[int]) -> dict[int, list[PhotographRow]]:
    """inspection_key -> the inspection's photographs in order of arrival, without their content."""
    of_keys: dict[int, list[PhotographRow]] = {key: [] for key in inspection_keys}
    rows = connection.execute(_photographs.where(among(inspection_photograph.c.inspection_key, inspection_keys)))
    of = _shown.reader(rows)
    for row in rows:
        of_keys[row.inspection_key].append(of(row))
    return of_keys


def data(connection: Connection, inspection_key: int, sha256: str) -> bytes | None:
    """The content of a photograph of that inspection, None if it has no such photograph."""
    of_inspection = select(photograph.c.data).join(
        inspection_photograph, inspection_photograph.c.sha256 == photograph.c.sha256
    )
    wanted = (inspection_photograph.c.inspection_key == inspection_key, photograph.c.sha256 == sha256)
    content: bytes | None = connection.execute(of_inspection.where(*wanted)).scalar()
    return content


def piece(connection: Connection, sha256: str, start: int, size: int) -> bytes:
    """This many bytes of a photograph from `start` on; the rest is not read into memory."""
    if connection.dialect.name == "sqlite":  # whose substr would read all of it first
        row: int = connection.execute(select(literal_column("rowid")).where(photograph.c.sha256 == sha256)).scalar_one()
        file: sqlite3.Connection = connection.connection.driver_connection  # type: ignore[assignment]
        with file.blobopen(photograph.name, photograph.c.data.name, row, readonly=True) as blob:
            blob.seek(start)
            return blob.read(size)
    content = func.substr(photograph.c.data, start + 1, size, type_=LargeBinary)
    return bytes(connection.execute(select(content).where(photograph.c.sha256 == sha256)).scalar_one())


def attach(connection: Connection, inspection_key: int, row: PhotographRow, content: bytes, *, position: int) -> None:
    """Add a photograph to an inspection; its content is stored unless it is already. Raises IntegrityError if the
    inspection has the photograph."""
    if connection.execute(select(photograph.c.sha256).where(photograph.c.sha256 == row.sha256)).first() is None:
        stored = {"sha256": row.sha256, "media_type": row.media_type, "bytes": row.bytes, "data": content}
        connection.execute(photograph.insert(), stored)
    attached = {"received_at": row.received_at, "received_by": row.received_by, "position": position}
    attached |= {"inspection_key": inspection_key, "sha256": row.sha256}
    connection.execute(inspection_photograph.insert(), attached)
