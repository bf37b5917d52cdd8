"""Keys that are bound to clutches and expire, when each was last used, and who posted a run."""

import sqlalchemy as sa
from alembic import op

revision = "s0006_key_bounds"
down_revision: str | None = "s0005_run_states"


def upgrade() -> None:
    """Make the columns. Keys that are there are bound to no clutch and do not expire; who posted earlier runs is unknown."""
    for name in ("clutches", "expires_at", "last_used_at"):
        op.add_column("access_key", sa.Column(name, sa.Text))
    op.add_column("run", sa.Column("received_by", sa.Text))
