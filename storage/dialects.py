"""Expressions that SQLite and PostgreSQL write differently, in pairs under one name.

JSON is text in both. Text is ordered by its code points in both, numbers are 64-bit floats, whole numbers have 64 bits.
"""

import json
import math
from collections.abc import Sequence
from typing import Any

import sqlalchemy as sa
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import FunctionElement
from sqlalchemy.types import NullType, TypeEngine


class _NumberOrNull(sa.TypeDecorator[float]):
    """PostgreSQL's double with NaN stored as NULL, as in SQLite, and refused in a required column."""

    impl = sa.Double
    cache_ok = True

    def process_bind_param(self, value: float | None, dialect: sa.Dialect) -> float | None:  # noqa: ARG002
        """The number, None in place of NaN."""
        return None if value is None or math.isnan(value) else value


TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
NUMBER: TypeEngine[float] = sa.REAL().with_variant(_NumberOrNull(), "postgresql")
WHOLE = sa.Integer().with_variant(sa.BigInteger(), "postgresql")


class DialectPair(FunctionElement[Any]):
    """An expression in SQLite's dialect and its equivalent in PostgreSQL's."""

    inherit_cache = True

    def __init__(self, of_sqlite: sa.ColumnElement[Any], of_postgresql: sa.ColumnElement[Any]) -> None:
        super().__init__(of_sqlite, of_postgresql)
        self.type = of_postgresql.type


@compiles(DialectPair, "sqlite")
def _as_sqlite(pair: DialectPair, compiler: SQLCompiler, **options: Any) -> str:
    return compiler.process(pair.clauses.clauses[0], **options)


@compiles(DialectPair, "postgresql")
def _as_postgresql(pair: DialectPair, compiler: SQLCompiler, **options: Any) -> str:
    return compiler.process(pair.clauses.clauses[1], **options)


def json_value(column: sa.ColumnElement[str], *path: str | int) -> sa.ColumnElement[Any]:
    """The value at `path` of the JSON in a text column, as a Python value; None if there is none. It must be neither a
    list nor an object."""
    of_postgresql = sa.cast(column, sa.JSON).op("#>", return_type=NullType())(_array(path))  # the driver decodes it
    return DialectPair(sa.func.json_extract(column, _sqlite_path(path)), of_postgresql)


def json_text(column: sa.ColumnElement[str], *path: str | int) -> sa.ColumnElement[str]:
    """The text at `path` of the JSON in a text column, for comparison; NULL if there is none."""
    of_postgresql = sa.cast(column, sa.JSON).op("#>>", return_type=sa.Text())(_array(path))
    return DialectPair(sa.func.json_extract(column, _sqlite_path(path)), of_postgresql)


def json_fields(column: sa.ColumnElement[str], *names: str) -> sa.ColumnElement[str]:
    """JSON text of these fields, lists and objects too, of the JSON in a text column; null for a missing field."""
    of_sqlite = [part for name in names for part in (name, sa.func.json_extract(column, _sqlite_path((name,))))]
    of_postgresql = [part for name in names for part in (name, sa.cast(column, sa.JSON).op("#>")(_array((name,))))]
    return DialectPair(sa.func.json_object(*of_sqlite), sa.cast(sa.func.json_build_object(*of_postgresql), sa.Text))


def json_length(column: sa.ColumnElement[str], *path: str) -> sa.ColumnElement[int]:
    """The length of the list at `path` of the JSON in a text column; NULL if there is none."""
    of_postgresql = sa.func.json_array_length(sa.cast(column, sa.JSON).op("#>")(_array(path)), type_=sa.Integer)
    return DialectPair(sa.func.json_array_length(column, _sqlite_path(path)), of_postgresql)


def among(column: sa.ColumnElement[Any], wanted: Sequence[str | int]) -> sa.ColumnElement[bool]:
    """Whether a column's value is one of these; any number of values is one parameter, JSON text."""
    parameter_list = sa.literal(json.dumps(list(wanted), ensure_ascii=False), sa.Text)
    of_sqlite = sa.func.json_each(parameter_list).table_valued("value").c.value
    of_postgresql = sa.func.json_array_elements_text(sa.cast(parameter_list, sa.JSON)).table_valued("value").c.value
    return DialectPair(column.in_(sa.select(of_sqlite)), column.in_(sa.select(sa.cast(of_postgresql, column.type))))


def now_in_seconds() -> sa.ColumnElement[float]:
    """Seconds since 1970 by the database's clock, the same for all processes that use it."""
    of_sqlite = (sa.func.julianday("now") - 2440587.5) * 86400.0
    return DialectPair(of_sqlite, sa.cast(sa.func.extract("epoch", sa.func.clock_timestamp()), sa.Double))


def newest_first(
    query: sa.Select[Any], key: sa.ColumnElement[int], *, before: float | None, limit: int | None
) -> sa.Select[Any]:
    """At most `limit` rows of a query, greatest key first, with keys less than `before`."""
    if before is not None:
        query = query.where(key < sa.literal(before, sa.Double))
    return query.order_by(key.desc()).limit(limit)


def _sqlite_path(path: Sequence[str | int]) -> str:
    return "$" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)


def _array(path: Sequence[str | int]) -> sa.ColumnElement[Any]:
    return sa.literal_column(f"'{{{','.join(map(str, path))}}}'")
