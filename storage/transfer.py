"""A database copied into another, table by table and batch by batch, so that an interrupted copy goes on where it was.

Rows go over in the order of their keys, each batch in a transaction of its own: what the target has of a table is its
beginning. The source is read in one transaction, and no service runs on either side. A digest over all values of all rows
says whether two tables are the same: SQLite keeps no sign of a zero, and neither database keeps a NaN, so 0.0 and -0.0 count
as the same, all other numbers bit by bit.
"""

import hashlib
import struct
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import chain
from typing import Any

from sqlalchemy import Connection, LargeBinary, Row, Table, func, insert, select, tuple_

from storage.engine.database import Database
from storage.engine.errors import DatabaseTooOld, TargetInUse
from storage.engine.integrity import mark, pending, release
from storage.engine.opening import find_database, open_unfinished, shown, sole_use
from storage.migrations.upgrade import current, head
from storage.tables import metadata

#: Rows that are fetched at once, of tables without and with binary columns: a record of 56 MB is a value. Chosen; no table.
_ROWS, _BINARY_ROWS = 500, 4


def rows_of(connection: Connection, table: Table, after: tuple[Any, ...] | None = None) -> Iterator[Row[Any]]:
    """The rows of a table in order of their keys, after `after` if given; few are in memory at once."""
    keys = list(table.primary_key)
    statement = select(table).order_by(*keys)
    if after is not None:
        statement = statement.where(tuple_(*keys) > tuple_(*after))
    binary = any(isinstance(column.type, LargeBinary) for column in table.columns)
    options = {"stream_results": True, "yield_per": _BINARY_ROWS if binary else _ROWS}
    yield from connection.execute(statement, execution_options=options)


def digest(connection: Connection, table: Table) -> tuple[int, str]:
    """The number of rows of a table, and the sha256 of all of them."""
    hashed, count = hashlib.sha256(), 0
    for row in rows_of(connection, table):
        count += 1
        for value in row:
            for part in _parts(value):
                hashed.update(part)
    return count, hashed.hexdigest()


def _parts(value: Any) -> tuple[bytes, ...]:
    """A value as unique bytes: its kind, its length, then its content."""
    if value is None:
        return (b"-",)
    if isinstance(value, float):
        return b"f", struct.pack("<d", value + 0.0)  # -0.0 + 0.0 is 0.0
    if isinstance(value, int):
        text = str(value).encode()
        return b"i", struct.pack("<q", len(text)), text
    data = value.encode() if isinstance(value, str) else bytes(value)
    return b"s" if isinstance(value, str) else b"b", struct.pack("<q", len(data)), data


#: Rows, and bytes of their texts and binaries, that one transaction stores. Chosen: what is lost by an interruption is a
#: second's work, and a batch is small beside the memory of a service.
MAX_ROWS, MAX_BYTES = 1000, 32_000_000

#: Called with a table's name and how many of its rows have just been stored.
Advance = Callable[[str, int], object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """A copy from a source database, being read, to a target, being filled. Made by `transfer`."""

    source: Connection
    target: Database

    def rows(self) -> int:
        return sum(_count(self.source, table) for table in metadata.sorted_tables)

    def copy(self, advance: Advance = lambda *_: None) -> None:
        """Copy the rows that the target lacks. `advance` is also called for rows already there."""
        for table in metadata.sorted_tables:
            with self.target.reading() as connection:
                last, count = _last_key(connection, table), _count(connection, table)
            advance(table.name, count)
            for batch in _batches(table, rows_of(self.source, table, last)):
                with self.target.writing() as connection:
                    connection.execute(insert(table), batch)
                advance(table.name, len(batch))

    def differing(self, advance: Advance = lambda *_: None) -> list[str]:
        """A sentence for each table that differs between the two sides; empty if they are equal."""
        differences = []
        for table in metadata.sorted_tables:
            with self.target.reading() as connection:
                ours, theirs = digest(self.source, table), digest(connection, table)
            if ours != theirs:
                differences.append(
                    f"table {table.name}: {ours[0]} rows of sha256 {ours[1]} became {theirs[0]} of {theirs[1]}"
                )
            advance(table.name, ours[0])
        return differences

    def release(self) -> None:
        """Mark the target as complete: keys continue after the last one, and services may use it."""
        with self.target.writing() as connection:
            if connection.dialect.name == "postgresql":
                for table in metadata.sorted_tables:
                    _continue_keys(connection, table)
                connection.exec_driver_sql("ANALYZE")  # the planner knows nothing of tables that were just filled
            release(connection)


@contextmanager
def transfer(source_url: str, target_url: str) -> Iterator[Transfer]:
    """The source, read in one transaction, and the target, marked as incomplete.

    Raises ServiceRuns where a service runs on either, DatabaseTooOld where the source is not at this release's revision,
    TargetInUse where the target holds anything but the beginning of a copy of this source.
    """
    with (
        sole_use(source_url),
        sole_use(target_url),
        closing(find_database(source_url)) as source,
        closing(open_unfinished(target_url)) as target,
        source.reading() as reader,
    ):
        if current(reader) != head():
            raise DatabaseTooOld(
                f"{shown(source_url)} is at revision {current(reader)}: `clutchlife serve` migrates it to {head()}"
            )
        _begin(target, shown(source_url), shown(target_url))
        yield Transfer(source=reader, target=target)


def _begin(target: Database, source: str, name: str) -> None:
    with target.writing() as connection:
        begun = pending(connection)
        if begun is None:
            used = [table.name for table in metadata.sorted_tables if _last_key(connection, table) is not None]
            if used:
                raise TargetInUse(f"{name} has rows in {', '.join(used)}: the target of a migration must be empty")
            mark(connection, source)
        elif begun != source:
            raise TargetInUse(f"{name} holds an unfinished migration from {begun}, not from {source}")


def _count(connection: Connection, table: Table) -> int:
    return int(connection.execute(select(func.count()).select_from(table)).scalar_one())


def _last_key(connection: Connection, table: Table) -> tuple[Any, ...] | None:
    keys = list(table.primary_key)
    row = connection.execute(select(*keys).order_by(*(key.desc() for key in keys)).limit(1)).first()
    return None if row is None else tuple(row)


def _batches(table: Table, rows: Iterator[Any]) -> Iterator[list[dict[str, Any]]]:
    names = [column.name for column in table.columns]
    batch: list[dict[str, Any]] = []
    size = 0
    for row in chain(rows, (None,)):
        if row is not None:
            batch.append(dict(zip(names, row, strict=True)))
            size += sum(len(value) for value in row if isinstance(value, (str, bytes)))
        if batch and (row is None or len(batch) >= MAX_ROWS or size >= MAX_BYTES):
            yield batch
            batch, size = [], 0


def _continue_keys(connection: Connection, table: Table) -> None:
    """Have a key sequence continue after the greatest copied key."""
    column = table.autoincrement_column
    if column is None:
        return
    last = connection.execute(select(func.max(column))).scalar_one()
    sequence = func.pg_get_serial_sequence(table.name, column.name)
    connection.execute(select(func.setval(sequence, last or 1, last is not None)))
