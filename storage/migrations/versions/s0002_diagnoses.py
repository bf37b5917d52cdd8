"""Diagnoses, the models that are adopted from them, and what these correct."""

import sqlalchemy as sa
from alembic import op

revision = "s0002_diagnoses"
down_revision: str | None = "s0001_first_tables"


def upgrade() -> None:
    """Make the tables; what is stored stays as it is."""
    op.create_table(
        "diagnosis",
        sa.Column("diagnosis_key", sa.Integer, primary_key=True),
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), nullable=False),
        sa.Column("diagnosis_id", sa.Text, nullable=False),
        sa.Column("created_at", sa.Text, nullable=False),
        sa.Column("finished_at", sa.Text),
        sa.Column("status", sa.Text, nullable=False),
        sa.Column("revision", sa.Integer, nullable=False),
        sa.Column("last_run_key", sa.Integer, nullable=False),
        sa.Column("life", sa.Text, nullable=False),
        sa.Column("as_of_cycles", sa.REAL),
        sa.Column("report", sa.Text),
        sa.Column("extension", sa.Text),
        sa.Column("problem", sa.Text),
        sa.Column("code_version", sa.Text, nullable=False),
        sa.UniqueConstraint("diagnosis_id", name="diagnosis_once"),
    )
    op.create_index("diagnosis_in_order", "diagnosis", ["clutch_id", "diagnosis_key"])
    op.create_table(
        "adopted_model",
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), primary_key=True),
        sa.Column("version", sa.Integer, primary_key=True),
        sa.Column("diagnosis_id", sa.Text, sa.ForeignKey("diagnosis.diagnosis_id")),
        sa.Column("adopted_at", sa.Text, nullable=False),
    )
    op.create_table(
        "corrected_cof",
        sa.Column("run_key", sa.Integer, sa.ForeignKey("run.run_key"), primary_key=True),
        sa.Column("pressure", sa.REAL, primary_key=True),
        sa.Column("mean_cof", sa.REAL, nullable=False),
        sa.Column("mean_cof_sd", sa.REAL, nullable=False),
    )
