"""What makes two tables the same: a digest over all values of all rows, in the order of their keys.

SQLite keeps no sign of a zero, and neither database keeps a NaN: 0.0 and -0.0 count as the same, all other numbers bit by
bit.
"""

import hashlib
import struct
from collections.abc import Iterator
from typing import Any

from sqlalchemy import Connection, LargeBinary, Row, Table, select, tuple_

#: Rows that are fetched at once, of tables without and with binary columns: a record of 56 MB is a value. Chosen; no table.
_ROWS, _BINARY_ROWS = 500, 4


def rows_of(connection: Connection, table: Table, after: tuple[Any, ...] | None = None) -> Iterator[Row[Any]]:
    """The rows of a table in the order of their keys, those after a key only; a few are in memory at once."""
    keys = list(table.primary_key)
    statement = select(table).order_by(*keys)
    if after is not None:
        statement = statement.where(tuple_(*keys) > tuple_(*after))
    binary = any(isinstance(column.type, LargeBinary) for column in table.columns)
    options = {"stream_results": True, "yield_per": _BINARY_ROWS if binary else _ROWS}
    yield from connection.execute(statement, execution_options=options)


def digest(connection: Connection, table: Table) -> tuple[int, str]:
    """How many rows a table has, and the sha256 of them all."""
    hashed, count = hashlib.sha256(), 0
    for row in rows_of(connection, table):
        count += 1
        for value in row:
            for part in _parts(value):
                hashed.update(part)
    return count, hashed.hexdigest()


def _parts(value: Any) -> tuple[bytes, ...]:
    """A value as bytes that no other value has, with its kind and length before it."""
    if value is None:
        return (b"-",)
    if isinstance(value, float):
        return b"f", struct.pack("<d", value + 0.0)  # -0.0 + 0.0 is 0.0
    if isinstance(value, int):
        text = str(value).encode()
        return b"i", struct.pack("<q", len(text)), text
    data = value.encode() if isinstance(value, str) else bytes(value)
    return b"s" if isinstance(value, str) else b"b", struct.pack("<q", len(data)), data
