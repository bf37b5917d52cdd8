"""Rig profiles by name: how the files that a rig's recorder writes are read."""

from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, bindparam, select

from storage.dialects import ALL_ROWS, upsert
from storage.encoding import Json, Rows
from storage.tables import rig


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRow:
    """A profile in force: `content` as it was posted with its defaults, `version` from 1 on, and who saved it when."""

    name: str
    version: int
    content: Json
    saved_at: str
    saved_by: str


_rows = Rows(RigRow)
_insert = sa.insert(rig)
_put = upsert(rig)
_by_name = select(rig).where(rig.c.name == bindparam("wanted"))
_in_order = select(rig).where(rig.c.name > bindparam("after")).order_by(rig.c.name).limit(bindparam("most"))


def insert(connection: Connection, row: RigRow) -> None:
    """Store a new profile. Raises IntegrityError where the name is taken."""
    connection.execute(_insert, _rows.values(row))


def put(connection: Connection, row: RigRow) -> None:
    """Store a profile in the place of the one of that name."""
    connection.execute(_put[connection.dialect.name], _rows.values(row))


def get(connection: Connection, name: str) -> RigRow | None:
    """The profile in force, or None."""
    return _rows.first(connection.execute(_by_name, {"wanted": name}))


def page(connection: Connection, *, limit: int | None = None, after: str = "") -> list[RigRow]:
    """Profiles by name, at most `limit`, behind the name `after`."""
    values = {"after": after, "most": ALL_ROWS if limit is None else limit}
    return _rows.all(connection.execute(_in_order, values))
