"""Corrected mean COF under each draw of the adopted model."""

import sqlalchemy as sa
from alembic import op

from storage.dialects import TEXT

revision = "s0013_corrected_cof_draws"
down_revision: str | None = "s0012_rigs"


def upgrade() -> None:
    """Make the column. Corrections that are there have none until they are computed again (`clutchlife replay`)."""
    op.add_column("corrected_cof", sa.Column("mean_cof_draws", TEXT))
