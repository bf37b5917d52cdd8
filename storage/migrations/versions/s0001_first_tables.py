"""The first tables: clutches and their runs, what was computed of them, and the access keys."""

import sqlalchemy as sa
from alembic import op

revision = "s0001_first_tables"
down_revision: str | None = None


def upgrade() -> None:
    """Make all tables."""
    _runs()
    _results()
    op.create_table(
        "access_key",
        sa.Column("key_id", sa.Text, primary_key=True),
        sa.Column("scope", sa.Text, nullable=False),
        sa.Column("secret_sha256", sa.Text, nullable=False),
        sa.Column("note", sa.Text, nullable=False),
        sa.Column("created_at", sa.Text, nullable=False),
        sa.Column("revoked_at", sa.Text),
        sa.UniqueConstraint("secret_sha256", name="access_key_secret"),
    )


def _runs() -> None:
    op.create_table(
        "clutch",
        sa.Column("clutch_id", sa.Text, primary_key=True),
        sa.Column("record", sa.Text, nullable=False),
        sa.Column("content_sha256", sa.Text, nullable=False),
        sa.Column("created_at", sa.Text, nullable=False),
        sa.Column("revision", sa.Integer, nullable=False),
        sa.Column("rank", sa.REAL, nullable=False),
        sa.Column("summary", sa.Text, nullable=False),
    )
    op.create_index("clutch_worst_first", "clutch", ["rank", "clutch_id"])
    op.create_table(
        "run",
        sa.Column("run_key", sa.Integer, primary_key=True),
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), nullable=False),
        sa.Column("run_id", sa.Text, nullable=False),
        sa.Column("kind", sa.Text, nullable=False),
        sa.Column("cycles", sa.REAL, nullable=False),
        sa.Column("started_at", sa.Text),
        sa.Column("received_at", sa.Text, nullable=False),
        sa.Column("content_sha256", sa.Text, nullable=False),
        sa.Column("details", sa.Text, nullable=False),
        sa.Column("receipt", sa.Text, nullable=False),
        sa.Column("code_version", sa.Text, nullable=False),
        sa.UniqueConstraint("clutch_id", "run_id", name="run_once_per_clutch"),
    )
    op.create_index("run_in_order", "run", ["clutch_id", "cycles", "run_id"])
    op.create_table(
        "channel",
        sa.Column("run_key", sa.Integer, sa.ForeignKey("run.run_key"), primary_key=True),
        sa.Column("name", sa.Text, primary_key=True),
        sa.Column("position", sa.Integer, nullable=False),
        sa.Column("codec", sa.Text, nullable=False),
        sa.Column("length", sa.Integer, nullable=False),
        sa.Column("data", sa.LargeBinary, nullable=False),
    )


def _results() -> None:
    op.create_table(
        "fit",
        sa.Column("run_key", sa.Integer, sa.ForeignKey("run.run_key"), primary_key=True),
        sa.Column("pressure", sa.REAL, primary_key=True),
        sa.Column("mean_pressure", sa.REAL, nullable=False),
        sa.Column("static_torque", sa.REAL, nullable=False),
        sa.Column("coulomb_ratio", sa.REAL, nullable=False),
        sa.Column("stribeck_velocity", sa.REAL, nullable=False),
        sa.Column("viscous_coefficient", sa.REAL, nullable=False),
        sa.Column("covariance", sa.Text, nullable=False),
        sa.Column("status", sa.Text, nullable=False),
        sa.Column("undetermined", sa.Text, nullable=False),
        sa.Column("noise", sa.REAL, nullable=False),
        sa.Column("mse_percent", sa.REAL),
        sa.Column("rmse", sa.REAL, nullable=False),
        sa.Column("points", sa.Integer, nullable=False),
        sa.Column("speeds", sa.Integer, nullable=False),
        sa.Column("mean_cof", sa.REAL),
        sa.Column("mean_cof_sd", sa.REAL),
        sa.Column("message", sa.Text, nullable=False),
        sa.Column("code_version", sa.Text, nullable=False),
    )
    op.create_table(
        "prediction",
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), primary_key=True),
        sa.Column("method", sa.Text, primary_key=True),
        sa.Column("pressure", sa.REAL, primary_key=True),
        sa.Column("cycles", sa.REAL, primary_key=True),
        sa.Column("payload", sa.Text, nullable=False),
        sa.Column("code_version", sa.Text, nullable=False),
    )
    op.create_table(
        "filter_state",
        sa.Column("clutch_id", sa.Text, sa.ForeignKey("clutch.clutch_id"), primary_key=True),
        sa.Column("method", sa.Text, primary_key=True),
        sa.Column("pressure", sa.REAL, primary_key=True),
        sa.Column("runs", sa.Integer, nullable=False),
        sa.Column("arrays", sa.LargeBinary, nullable=False),
        sa.Column("code_version", sa.Text, nullable=False),
    )
