"""Rig profiles by name: how the files that a rig's recorder writes are read."""

from collections.abc import Iterator
from dataclasses import dataclass

from sqlalchemy import Connection, select

from storage.encoding import Json
from storage.rows import Rows, upsert
from storage.tables import rig

#: Profiles in memory at once. Chosen: one of a thousand columns is a quarter of a megabyte of JSON and some ten in memory.
MAX_AT_ONCE = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRow:
    """A profile in force: `content` as posted, with its defaults, `version` from 1 on, and its author and time."""

    name: str
    version: int
    content: Json
    saved_at: str
    saved_by: str


_rows = Rows(RigRow, of=rig)


def insert(connection: Connection, row: RigRow) -> None:
    """Store a new profile. Raises IntegrityError where the name is taken."""
    connection.execute(rig.insert(), _rows.values(row))


def put(connection: Connection, row: RigRow) -> None:
    upsert(connection, rig, [_rows.values(row)])


def get(connection: Connection, name: str) -> RigRow | None:
    return _rows.first(connection.execute(select(rig).where(rig.c.name == name)))


def page(connection: Connection, *, limit: int = MAX_AT_ONCE, after: str = "") -> list[RigRow]:
    """A page of profiles by name, at most `limit`, after the name `after`."""
    return _rows.all(connection.execute(select(rig).where(rig.c.name > after).order_by(rig.c.name).limit(limit)))


def every(connection: Connection) -> Iterator[RigRow]:
    """All profiles by name, read page by page."""
    rows = page(connection)
    while rows:
        yield from rows
        rows = page(connection, after=rows[-1].name)
