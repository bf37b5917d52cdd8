"""A checksum in each row of what is stored of clutches: written with the row, checked when the row is read whole.

It is the CRC-32 of all other columns as the database has them, by the order of their names, but for a key that the database
gives. A row that was changed in any other way than by this program fails it.

A row that fails is an error, DamagedData. A transaction may `allow_damage` in the tables of what follows from the runs: that
is then computed again, and written with the right checksum.
"""

import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import sqlalchemy as sa

from storage.engine.errors import DamagedData
from storage.tables import CHECKSUM

_ALLOWED = "damage_is_allowed"
_FOLLOW_FROM_RUNS = ("clutch", "run", "fit", "prediction", "filter_state", "corrected_cof")
_Plain = Callable[[Any], bytes]


@cache
def covered(table: sa.Table) -> tuple[tuple[str, _Plain], ...]:
    """The columns covered by a table's checksums, by name, each with its conversion to bytes."""
    key = list(table.primary_key)
    given = key[0].name if len(key) == 1 and isinstance(key[0].type, sa.Integer) else None
    names = sorted(column.name for column in table.columns if column.name not in (CHECKSUM, given))
    return tuple((name, _plain(table.c[name].type)) for name in names)


def _plain(kind: Any) -> _Plain:
    if isinstance(kind, sa.LargeBinary):
        return bytes
    if isinstance(kind, sa.Integer):
        return lambda value: b"%d" % value
    if isinstance(kind, sa.Text):
        return lambda value: value.encode("utf-8", "surrogatepass")
    return lambda value: repr(float(value)).encode()


def of_values(table: sa.Table, values: Mapping[str, Any]) -> int:
    """The checksum of a row's values. NaN is stored as null."""
    parts = []
    for name, plain in covered(table):
        value = values[name]
        parts.append(b"\0" if value is None or value != value else plain(value))
    return zlib.crc32(b"\x1f".join(parts))


def sealed(table: sa.Table, values: dict[str, Any]) -> dict[str, Any]:
    """The columns of a row with the checksum added."""
    return values | {CHECKSUM: of_values(table, values)}


def refuse_damaged(table: sa.Table, row: Mapping[str, Any]) -> None:
    """Raise DamagedData if a row fails its checksum."""
    if fails(table, row):
        key = ", ".join(f"{column.name} {row[column.name]}" for column in table.primary_key)
        raise DamagedData(f"{table.name} ({key}) is not what was stored")


def fails(table: sa.Table, row: Mapping[str, Any]) -> bool:
    """Whether a row fails its checksum."""
    return bool(of_values(table, row) != row[CHECKSUM])


def allow_damage(connection: sa.Connection, *, everywhere: bool = False) -> None:
    """Let this transaction read and replace damaged results (rows that fail their checksum), or read any damaged rows
    if `everywhere`."""
    connection.execution_options(**{_ALLOWED: "everywhere" if everywhere else "in results"})


def allows_damage(rows: sa.Result[Any], table: sa.Table) -> bool:
    """Whether these rows of a table were read in such a transaction, and may be damaged."""
    context = getattr(rows, "context", None)
    where = None if context is None else context.execution_options.get(_ALLOWED)
    return where == "everywhere" or (where is not None and table.name in _FOLLOW_FROM_RUNS)


def amend(
    connection: sa.Connection,
    table: sa.Table,
    this: Sequence[sa.ColumnElement[bool]],
    *,
    checked: bool = True,
    **columns: Any,
) -> int:
    """Change columns of rows, each by a value or a function of the old row; returns the number of rows. Raises
    DamagedData."""
    found = connection.execute(sa.select(table).where(*this).with_for_update())
    allowed = not checked or allows_damage(found, table)
    rows = [dict(row) for row in found.mappings()]
    for row in rows:
        if not allowed:
            refuse_damaged(table, row)
        changed = {name: value(row) if callable(value) else value for name, value in columns.items()}
        own = [column == row[column.name] for column in table.primary_key]
        connection.execute(sa.update(table).where(*own).values(sealed(table, {**row, **changed})))
    return len(rows)


def findings(connection: sa.Connection, table: sa.Table, this: sa.ColumnElement[bool]) -> list[str]:
    """A sentence for each row of a table that fails its checksum."""
    found = []
    for row in connection.execute(sa.select(table).where(this)).mappings():
        try:
            refuse_damaged(table, dict(row))
        except DamagedData as error:
            found.append(str(error))
    return found
