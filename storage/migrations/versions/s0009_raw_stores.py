"""Raw records may lie in a store beside the database: which stores there are, and which channel is in which."""

import sqlalchemy as sa
from alembic import op

revision = "s0009_raw_stores"
down_revision: str | None = "s0008_jobs"

_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_WHOLE = sa.Integer().with_variant(sa.BigInteger(), "postgresql")
_NUMBER: sa.types.TypeEngine[float] = sa.REAL().with_variant(sa.Double(), "postgresql")


def upgrade() -> None:
    """Make the tables and columns. Channels that are there stay in the database."""
    op.create_table(
        "raw_store",
        sa.Column("store_key", _WHOLE, primary_key=True),
        sa.Column("address", _TEXT, nullable=False),
        sa.Column("mark", _TEXT, nullable=False),
        sa.Column("in_use", _WHOLE, nullable=False, server_default="0"),
        sa.Column("removals", _WHOLE, nullable=False, server_default="0"),
        sa.UniqueConstraint("address", name="raw_store_once"),
    )
    op.create_table(
        "raw_removal",
        sa.Column("store_key", _WHOLE, sa.ForeignKey("raw_store.store_key"), primary_key=True),
        sa.Column("blob", _TEXT, primary_key=True),
        sa.Column("number", _WHOLE, nullable=False),
        sa.Column("at", _NUMBER, nullable=False),
        sa.Column("finished", _WHOLE, nullable=False),
    )
    kind, collation = ("BIGINT", ' COLLATE "C"') if op.get_bind().dialect.name == "postgresql" else ("INTEGER", "")
    # Alembic knows no reference in a new column of SQLite's, which has no other way to make one
    op.execute(f"ALTER TABLE channel ADD COLUMN store_key {kind} REFERENCES raw_store (store_key)")
    op.execute(f"ALTER TABLE channel ADD COLUMN blob TEXT{collation}")
    named = sa.text("blob IS NOT NULL")
    op.create_index("channel_in_store", "channel", ["store_key", "blob"], sqlite_where=named, postgresql_where=named)
