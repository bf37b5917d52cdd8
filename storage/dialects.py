"""Expressions that SQLite and PostgreSQL write differently, in pairs under one name.

JSON is text in both. Text is ordered by its code points in both, numbers are 64-bit floats, whole numbers have 64 bits.
"""

import math
from collections.abc import Sequence
from typing import Any

from sqlalchemy import (
    JSON,
    REAL,
    BigInteger,
    ColumnElement,
    Dialect,
    Double,
    Insert,
    Integer,
    Table,
    Text,
    TypeDecorator,
    bindparam,
    cast,
    func,
    literal_column,
    select,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.types import NullType, TypeEngine


class _NumberOrNull(TypeDecorator[float]):
    """A double of PostgreSQL's; NaN is stored as NULL, as SQLite stores it, and refused where there must be a number."""

    impl = Double
    cache_ok = True

    def process_bind_param(self, value: float | None, dialect: Dialect) -> float | None:  # noqa: ARG002
        """The number, None in place of NaN."""
        return None if value is None or math.isnan(value) else value


TEXT = Text().with_variant(Text(collation="C"), "postgresql")
NUMBER: TypeEngine[float] = REAL().with_variant(_NumberOrNull(), "postgresql")
WHOLE = Integer().with_variant(BigInteger(), "postgresql")
#: A LIMIT that leaves nothing out: more rows than an answer can hold.
ALL_ROWS = 2**31 - 1


class Pair(FunctionElement[Any]):
    """An expression as SQLite knows it, and the same as PostgreSQL does."""

    inherit_cache = True

    def __init__(self, of_sqlite: ColumnElement[Any], of_postgresql: ColumnElement[Any]) -> None:
        super().__init__(of_sqlite, of_postgresql)
        self.type = of_postgresql.type


@compiles(Pair, "sqlite")
def _as_sqlite(pair: Pair, compiler: SQLCompiler, **options: Any) -> str:
    return compiler.process(pair.clauses.clauses[0], **options)


@compiles(Pair, "postgresql")
def _as_postgresql(pair: Pair, compiler: SQLCompiler, **options: Any) -> str:
    return compiler.process(pair.clauses.clauses[1], **options)


def json_value(column: ColumnElement[str], *path: str | int) -> ColumnElement[Any]:
    """The value at `path` of the JSON in a text column, as Python has it; None where there is none. No list, no object."""
    of_postgresql = cast(column, JSON).op("#>", return_type=NullType())(_array(path))  # the driver decodes it
    return Pair(func.json_extract(column, _sqlite_path(path)), of_postgresql)


def json_text(column: ColumnElement[str], *path: str | int) -> ColumnElement[str]:
    """The text at `path` of the JSON in a text column, to be compared; NULL where there is none."""
    of_postgresql = cast(column, JSON).op("#>>", return_type=Text())(_array(path))
    return Pair(func.json_extract(column, _sqlite_path(path)), of_postgresql)


def json_fields(column: ColumnElement[str], *names: str) -> ColumnElement[str]:
    """JSON text with these fields, lists and objects too, of the JSON in a text column; null where it has none."""
    of_sqlite = [part for name in names for part in (name, func.json_extract(column, _sqlite_path((name,))))]
    of_postgresql = [part for name in names for part in (name, cast(column, JSON).op("#>")(_array((name,))))]
    return Pair(func.json_object(*of_sqlite), cast(func.json_build_object(*of_postgresql), Text))


def json_length(column: ColumnElement[str], *path: str) -> ColumnElement[int]:
    """How many items the list at `path` of the JSON in a text column has; NULL where there is none."""
    of_postgresql = func.json_array_length(cast(column, JSON).op("#>")(_array(path)), type_=Integer)
    return Pair(func.json_array_length(column, _sqlite_path(path)), of_postgresql)


def among(column: ColumnElement[Any], parameter: str) -> ColumnElement[bool]:
    """Whether a column's value is one of the list that the parameter holds as JSON text, however long that is."""
    given = bindparam(parameter, type_=Text)
    of_sqlite = func.json_each(given).table_valued("value").c.value
    of_postgresql = func.json_array_elements_text(cast(given, JSON)).table_valued("value").c.value
    return Pair(column.in_(select(of_sqlite)), column.in_(select(cast(of_postgresql, column.type))))


def now_in_seconds() -> ColumnElement[float]:
    """Seconds since 1970 by the clock of the database, which is one for all processes that use it."""
    of_sqlite = (func.julianday("now") - 2440587.5) * 86400.0
    return Pair(of_sqlite, cast(func.extract("epoch", func.clock_timestamp()), Double))


def upsert(table: Table) -> dict[str, Insert]:
    """dialect -> the INSERT that puts a row in the place of the one with the same primary key."""
    keys = [column.name for column in table.primary_key]
    others = [column.name for column in table.columns if not column.primary_key]
    of_sqlite, of_postgresql = sqlite.insert(table), postgresql.insert(table)
    return {
        "sqlite": of_sqlite.on_conflict_do_update(
            index_elements=keys, set_={name: of_sqlite.excluded[name] for name in others}
        ),
        "postgresql": of_postgresql.on_conflict_do_update(
            index_elements=keys, set_={name: of_postgresql.excluded[name] for name in others}
        ),
    }


def _sqlite_path(path: Sequence[str | int]) -> str:
    return "$" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def _array(path: Sequence[str | int]) -> ColumnElement[Any]:
    return literal_column(f"'{{{','.join(map(str, path))}}}'")
