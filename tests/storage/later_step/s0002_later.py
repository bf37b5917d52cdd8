"""A step as one after the first would be."""

import sqlalchemy as sa
from alembic import op

revision = "s0002_later"
down_revision: str | None = "s0001_first_tables"


def upgrade() -> None:
    """Make a column; what is stored stays as it is."""
    op.add_column("clutch", sa.Column("later", sa.Text))
