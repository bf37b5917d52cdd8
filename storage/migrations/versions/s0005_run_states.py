"""Runs that are held or withdrawn, what was sent before a correction, archived clutches, and the audit trail."""

import sqlalchemy as sa
from alembic import op

revision = "s0005_run_states"
down_revision: str | None = "s0004_prediction_gain"


def upgrade() -> None:
    """Make the columns and the table. All runs that are there are accepted, all clutches in use, as they were sent."""
    op.add_column("run", sa.Column("state", sa.Text, nullable=False, server_default="accepted"))
    op.add_column("run", sa.Column("sent_cycles", sa.REAL))
    op.add_column("run", sa.Column("doubts", sa.Text, nullable=False, server_default="[]"))
    op.add_column("clutch", sa.Column("archived", sa.Integer, nullable=False, server_default="0"))
    op.add_column("clutch", sa.Column("registered", sa.Text))
    op.create_table(
        "change",
        sa.Column("change_key", sa.Integer, primary_key=True),
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), nullable=False),
        sa.Column("run_id", sa.Text),
        sa.Column("at", sa.Text, nullable=False),
        sa.Column("by", sa.Text, nullable=False),
        sa.Column("action", sa.Text, nullable=False),
        sa.Column("reason", sa.Text, nullable=False),
        sa.Column("before", sa.Text, nullable=False),
        sa.Column("after", sa.Text, nullable=False),
        sa.Column("revision", sa.Integer, nullable=False),
    )
    op.create_index("change_in_order", "change", ["clutch_id", "change_key"])
