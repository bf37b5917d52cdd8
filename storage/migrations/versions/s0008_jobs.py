"""Jobs as rows, which any service on the database claims, retries and cancels."""

from datetime import UTC, datetime

import sqlalchemy as sa
from alembic import op

from storage.dialects import NUMBER, TEXT, WHOLE

revision = "s0008_jobs"
down_revision: str | None = "s0007_inspections"

_OPEN_ONLY = sa.text("state IN ('waiting', 'running')")


def upgrade() -> None:
    """Make the table. Diagnoses that an earlier release left running have no job, and failed."""
    op.create_table(
        "job",
        sa.Column("job_key", WHOLE, primary_key=True),
        sa.Column("job_id", TEXT, nullable=False),
        sa.Column("kind", TEXT, nullable=False),
        sa.Column("clutch_id", TEXT, sa.ForeignKey("clutch.clutch_id")),
        sa.Column("state", TEXT, nullable=False),
        sa.Column("asked_at", TEXT, nullable=False),
        sa.Column("asked_by", TEXT, nullable=False),
        sa.Column("arguments", TEXT, nullable=False),
        sa.Column("attempts", WHOLE, nullable=False),
        sa.Column("claimed_by", TEXT),
        sa.Column("leased_until", NUMBER),
        sa.Column("started_at", TEXT),
        sa.Column("finished_at", TEXT),
        sa.Column("progress", TEXT),
        sa.Column("problem", TEXT),
        sa.UniqueConstraint("job_id", name="job_once"),
    )
    op.create_index("job_open", "job", ["job_key"], sqlite_where=_OPEN_ONLY, postgresql_where=_OPEN_ONLY)
    op.create_index("job_of_clutch", "job", ["clutch_id", "started_at"])
    ended = sa.text(
        "UPDATE diagnosis SET status = 'failed', finished_at = :at, problem = :problem WHERE status = 'running'"
    )
    at = datetime.now(UTC).isoformat(timespec="milliseconds")
    op.execute(ended.bindparams(at=at, problem="the service ended while the diagnosis ran: ask again"))
