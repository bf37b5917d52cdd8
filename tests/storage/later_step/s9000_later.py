"""A step as one after the last would be."""

import sqlalchemy as sa
from alembic import op

revision = "s9000_later"
down_revision: str | None = "s0007_states_of_a_revision"


def upgrade() -> None:
    """Make a column; what is stored stays as it is."""
    op.add_column("clutch", sa.Column("later", sa.Text))
