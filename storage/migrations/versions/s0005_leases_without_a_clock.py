"""A running job has the number of its lease's prolongations in place of the moment at which that ends."""

import sqlalchemy as sa
from alembic import op

from storage.dialects import WHOLE

revision = "s0005_leases_without_a_clock"
down_revision: str | None = "s0004_checksums"


def upgrade() -> None:
    """Put one column in the place of the other."""
    op.add_column("job", sa.Column("renewals", WHOLE, nullable=False, server_default=sa.text("0")))
    op.drop_column("job", "leased_until")
