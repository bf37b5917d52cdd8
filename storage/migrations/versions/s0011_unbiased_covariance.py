"""A fit's covariance as the tests of a life need it, beside that of the interval of one test."""

import sqlalchemy as sa
from alembic import op

from storage.dialects import TEXT

revision = "s0011_unbiased_covariance"
down_revision: str | None = "s0010_clutch_states"


def upgrade() -> None:
    """Make the column. Fits that are there have none until they are computed anew (`clutchlife replay`)."""
    op.add_column("fit", sa.Column("unbiased_covariance", TEXT))
