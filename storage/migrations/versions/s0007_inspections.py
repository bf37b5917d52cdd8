"""Inspections of a clutch's friction surface, and photographs as their files, each kept once by its hash."""

import sqlalchemy as sa
from alembic import op

revision = "s0007_inspections"
down_revision: str | None = "s0006_key_bounds"


def upgrade() -> None:
    """Make the tables. Clutches that are there have no inspections."""
    op.create_table(
        "inspection",
        sa.Column("inspection_key", sa.Integer, primary_key=True),
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), nullable=False),
        sa.Column("inspection_id", sa.Text, nullable=False),
        sa.Column("cycles", sa.REAL, nullable=False),
        sa.Column("content", sa.Text, nullable=False),
        sa.Column("content_sha256", sa.Text, nullable=False),
        sa.Column("received_at", sa.Text, nullable=False),
        sa.Column("received_by", sa.Text, nullable=False),
        sa.Column("state", sa.Text, nullable=False),
        sa.UniqueConstraint("clutch_id", "inspection_id", name="inspection_once_per_clutch"),
    )
    op.create_index("inspection_in_order", "inspection", ["clutch_id", "cycles", "inspection_id"])
    op.create_table(
        "photograph",
        sa.Column("sha256", sa.Text, primary_key=True),
        sa.Column("media_type", sa.Text, nullable=False),
        sa.Column("bytes", sa.Integer, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )
    op.create_table(
        "inspection_photograph",
        sa.Column("inspection_key", sa.Integer, sa.ForeignKey("inspection.inspection_key"), primary_key=True),
        sa.Column("sha256", sa.Text, sa.ForeignKey("photograph.sha256"), primary_key=True),
        sa.Column("position", sa.Integer, nullable=False),
        sa.Column("received_at", sa.Text, nullable=False),
        sa.Column("received_by", sa.Text, nullable=False),
    )
