"""Rows of what is stored of clutches have a checksum of all their other columns (`storage.rows`).

Those that are there get that of what they hold now.
"""

import zlib
from typing import Any

import sqlalchemy as sa
from alembic import op

from storage.dialects import WHOLE

revision = "s0004_checksums"
down_revision: str | None = "s0003_laws_of_ended_lives"

_TABLES = (
    "clutch", "run", "fit", "prediction", "filter_state", "diagnosis", "adopted_model", "corrected_cof", "fleet_prior",
    "inspection", "rig", "alarm", "alarm_event", "webhook", "change",
)  # fmt: skip
#: Rows in memory at once. Chosen: some megabytes of receipts.
_AT_ONCE = 500


def upgrade() -> None:
    """Add the column, and fill it."""
    connection = op.get_bind()
    for name in _TABLES:
        op.add_column(name, sa.Column("checksum", WHOLE, nullable=False, server_default=sa.text("0")))
        fill(connection, name)


def fill(connection: sa.Connection, name: str) -> None:
    """Write the checksum of every row of a table."""
    table = sa.Table(name, sa.MetaData(), autoload_with=connection)
    keys = {f"key_{key.name}": key.name for key in table.primary_key}
    filled = sa.table(name, sa.column("checksum"), *map(sa.column, keys.values()))
    own = [filled.c[column] == sa.bindparam(key) for key, column in keys.items()]
    update = sa.update(filled).where(*own).values(checksum=sa.bindparam("sum"))
    rows = connection.execute(sa.select(table), execution_options={"yield_per": _AT_ONCE}).mappings()
    for part in rows.partitions():
        sums = [{key: row[column] for key, column in keys.items()} | {"sum": _checksum(table, row)} for row in part]
        connection.execute(update, sums)


def _checksum(table: sa.Table, row: sa.RowMapping) -> int:
    keys = list(table.primary_key)
    given = keys[0].name if len(keys) == 1 and isinstance(keys[0].type, sa.Integer) else None
    names = sorted(column.name for column in table.columns if column.name not in ("checksum", given))
    return zlib.crc32(b"\x1f".join(_bytes(table.c[name].type, row[name]) for name in names))


def _bytes(kind: Any, value: Any) -> bytes:
    if value is None:
        return b"\0"
    if isinstance(kind, sa.LargeBinary):
        return bytes(value)
    if isinstance(kind, sa.Integer):
        return b"%d" % value
    return str(value).encode("utf-8", "surrogatepass") if isinstance(kind, sa.Text) else repr(float(value)).encode()
