"""A step as one after the last would be."""

import sqlalchemy as sa
from alembic import op

revision = "s9000_later"
down_revision: str | None = "s0006_fits_keep_their_points"


def upgrade() -> None:
    """Make a column; what is stored stays as it is."""
    op.add_column("clutch", sa.Column("later", sa.Text))
