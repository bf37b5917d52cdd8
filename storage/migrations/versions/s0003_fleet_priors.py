"""Priors learned from fleets of earlier lives."""

import sqlalchemy as sa
from alembic import op

revision = "s0003_fleet_priors"
down_revision: str | None = "s0002_diagnoses"


def upgrade() -> None:
    """Make the table. Filter states are dropped: the next run computes them again. So are the exact filter's predictions:
    they are computed when requested."""
    op.create_table(
        "fleet_prior",
        sa.Column("fleet", sa.Text, primary_key=True),
        sa.Column("version", sa.Integer, primary_key=True),
        sa.Column("left_out", sa.Text, primary_key=True),
        sa.Column("created_at", sa.Text, nullable=False),
        sa.Column("members", sa.Text, nullable=False),
        sa.Column("content", sa.Text, nullable=False),
        sa.Column("code_version", sa.Text, nullable=False),
    )
    op.execute("DELETE FROM filter_state")
    op.execute("DELETE FROM prediction WHERE method = 'grid'")
