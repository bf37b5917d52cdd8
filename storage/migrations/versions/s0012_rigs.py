"""Rig profiles: how the files of a rig are read."""

import sqlalchemy as sa
from alembic import op

revision = "s0012_rigs"
down_revision: str | None = "s0011_unbiased_covariance"

_TEXT = sa.Text().with_variant(sa.Text(collation="C"), "postgresql")
_WHOLE = sa.Integer().with_variant(sa.BigInteger(), "postgresql")


def upgrade() -> None:
    """Make the table. The files of runs that are there were not kept."""
    op.create_table(
        "rig",
        sa.Column("name", _TEXT, primary_key=True),
        sa.Column("version", _WHOLE, nullable=False),
        sa.Column("content", _TEXT, nullable=False),
        sa.Column("saved_at", _TEXT, nullable=False),
        sa.Column("saved_by", _TEXT, nullable=False),
    )
