"""Rows of tables: values made of rows and rows of values, with a checksum that is written with the row and checked when the
row is read whole.

The type of a dataclass' field says how its column is stored (`Rows`): a JSON object, a list or a tuple is JSON text, named
arrays are packed, a flag is 0 or 1; all else is stored as it is.

The checksum is the CRC-32 of all other columns as the database has them, by the order of their names, but for a key that the
database gives. A row that was changed in any other way than by this program fails it, which is an error, DamagedData. A
transaction may `allow_damage` in the tables of what follows from the runs: that is then computed again, and written with
the right checksum.
"""

import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from operator import itemgetter
from types import UnionType
from typing import Any, Generic, TypeVar, get_args, get_origin, get_type_hints

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from storage.encoding import pack, to_list, to_object, to_text, unpack
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
) -> list[dict[str, Any]]:
    """Change columns of rows, each by a value or a function of the old row; returns the new rows. Raises DamagedData."""
    found = connection.execute(sa.select(table).where(*this).with_for_update())
    allowed = not checked or allows_damage(found, table)
    rows = [dict(row) for row in found.mappings()]
    for row in rows:
        if not allowed:
            refuse_damaged(table, row)
        key = {f"at_{column.name}": row[column.name] for column in table.primary_key}
        row |= {name: value(row) if callable(value) else value for name, value in columns.items()}
        connection.execute(_update(table), key | sealed(table, row))
    return rows


@cache
def _update(table: sa.Table) -> sa.Update:
    """A row of a table, by its key `at_…`, gets the columns with which this is executed."""
    return sa.update(table).where(*(column == sa.bindparam(f"at_{column.name}") for column in table.primary_key))


def findings(connection: sa.Connection, table: sa.Table, this: sa.ColumnElement[bool]) -> list[str]:
    """A sentence for each row of a table that fails its checksum."""
    found = []
    for row in connection.execute(sa.select(table).where(this)).mappings():
        try:
            refuse_damaged(table, dict(row))
        except DamagedData as error:
            found.append(str(error))
    return found


def upsert(connection: sa.Connection, table: sa.Table, rows: Sequence[dict[str, Any]]) -> None:
    """Store rows, replacing those with the same primary key."""
    if rows:
        connection.execute(_upsert(table, connection.dialect.name), rows)


@cache
def _upsert(table: sa.Table, dialect: str) -> sa.Insert:
    insert: sqlite.Insert | postgresql.Insert
    insert = sqlite.insert(table) if dialect == "sqlite" else postgresql.insert(table)
    values = {column.name: insert.excluded[column.name] for column in table.columns if not column.primary_key}
    return insert.on_conflict_do_update(index_elements=list(table.primary_key), set_=values)


Value = TypeVar("Value")
_Coding = tuple[Callable[[Any], Any], Callable[[Any], Any]]
_of_list: _Coding = (to_text, lambda text: tuple(to_list(text)))
_CODINGS: dict[Any, _Coding] = {
    dict: (to_text, to_object),
    tuple: _of_list,
    Sequence: _of_list,
    Mapping: (pack, partial(unpack, booleans=True)),
    bool: (int, bool),
}


class Rows(Generic[Value]):
    """Conversion between a dataclass and its rows, which may have other columns too; the database assigns the `key`.

    Complete rows `of` a table have a checksum, and are `checked` for it when they are read.
    """

    def __init__(self, kind: type[Value], *, key: str = "", of: sa.Table | None = None, checked: bool = True) -> None:
        self._kind, self._key, self._of, self._checked = kind, key, of, checked
        hints = get_type_hints(kind)
        self.names = tuple(hints)
        codings = {name: _coding(hint) for name, hint in hints.items()}
        self._coded = {name: coding for name, coding in codings.items() if coding is not None}

    def values(self, value: Value, **others: object) -> dict[str, Any]:
        """A value's columns by name, without its key; `others` replace or complement the value's own."""
        values = self.columns(**{name: getattr(value, name) for name in self.names if name != self._key}) | others
        return values if self._of is None else sealed(self._of, values)

    def columns(self, **fields: object) -> dict[str, Any]:
        """Some fields in the form of their columns."""
        for name in self._coded.keys() & fields.keys():
            fields[name] = None if fields[name] is None else self._coded[name][0](fields[name])
        return fields

    def reader(self, rows: sa.Result[*tuple[Any, ...]]) -> Callable[[sa.Row[*tuple[Any, ...]]], Value]:
        """A function that converts these rows to values; the positions of the fields are looked up once. Raises
        DamagedData; if damage is allowed, a field that cannot be decoded is empty instead."""
        columns = list(rows.keys())
        fields_of = itemgetter(*map(columns.index, self.names))
        table = self._of
        damage_allowed = table is not None and allows_damage(rows, table)

        def of(row: sa.Row[*tuple[Any, ...]]) -> Value:
            if table is not None and self._checked and not damage_allowed:
                refuse_damaged(table, dict(zip(columns, row, strict=True)))
            fields = dict(zip(self.names, fields_of(row), strict=True))
            for name, (_, decode) in self._coded.items():
                try:
                    fields[name] = None if fields[name] is None else decode(fields[name])
                except ValueError as error:
                    if not damage_allowed:
                        raise DamagedData(f"{name} of a {self._kind.__name__} cannot be read: {error}") from error
                    fields[name] = {}
            return self._kind(**fields)

        return of

    def all(self, rows: sa.Result[*tuple[Any, ...]]) -> list[Value]:
        return list(map(self.reader(rows), rows))

    def first(self, rows: sa.Result[*tuple[Any, ...]]) -> Value | None:
        of, row = self.reader(rows), rows.first()
        return None if row is None else of(row)


def _coding(hint: Any) -> _Coding | None:
    """A field's conversion to its column and back; None if the field is stored unchanged."""
    kinds = get_args(hint) if get_origin(hint) is UnionType else (hint,)
    return next((_CODINGS[plain] for kind in kinds if (plain := get_origin(kind) or kind) in _CODINGS), None)
