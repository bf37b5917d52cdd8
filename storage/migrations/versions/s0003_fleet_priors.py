"""What fleets of earlier lives say of the next clutch."""

import sqlalchemy as sa
from alembic import op

revision = "s0003_fleet_priors"
down_revision: str | None = "s0002_diagnoses"


def upgrade() -> None:
    """Make the table; filter states are dropped, for the next run makes them anew, and what the exact filter said, for it is
    worked out when asked."""
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
