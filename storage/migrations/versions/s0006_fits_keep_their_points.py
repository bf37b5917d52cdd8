"""A fit has whether it is acceptable, and the measured points where its static torque is open.

Of those that are stored the first is what eq. 5 says, and the points are not there, until the clutch is replayed.
"""

import sqlalchemy as sa
from alembic import op

from storage.dialects import WHOLE
from storage.migrations.versions.s0004_checksums import fill

revision = "s0006_fits_keep_their_points"
down_revision: str | None = "s0005_leases_without_a_clock"

_fit = sa.table("fit", sa.column("acceptable"), sa.column("mse_percent"))


def upgrade() -> None:
    """Add the columns, and write the checksums of rows that are longer now."""
    connection = op.get_bind()
    op.add_column("fit", sa.Column("acceptable", WHOLE, nullable=False, server_default=sa.text("0")))
    op.add_column("fit", sa.Column("measured", sa.Text))
    connection.execute(sa.update(_fit).where(_fit.c.mse_percent < 5.0).values(acceptable=1))
    fill(connection, "fit")
