"""A clutch has a checksum over those of its filter states, as they are now."""

import zlib
from itertools import groupby

import sqlalchemy as sa
from alembic import op

from storage.dialects import WHOLE
from storage.migrations.versions.s0004_checksums import fill

revision = "s0007_states_of_a_revision"
down_revision: str | None = "s0006_fits_keep_their_points"

_clutch = sa.table("clutch", sa.column("clutch_id"), sa.column("states_sum"))
_state = sa.table("filter_state", *map(sa.column, ("clutch_id", "method", "pressure", "checksum")))


def upgrade() -> None:
    """Add the column, fill it, and write the checksums of rows that are longer now."""
    connection = op.get_bind()
    op.add_column("clutch", sa.Column("states_sum", WHOLE, nullable=False, server_default=sa.text("0")))
    rows = connection.execute(sa.select(_state.c.clutch_id, _state.c.checksum).order_by(*_state.c)).all()
    for clutch_id, states in groupby(rows, key=lambda row: row.clutch_id):
        states_sum = zlib.crc32(b",".join(b"%d" % row.checksum for row in states))
        connection.execute(sa.update(_clutch).where(_clutch.c.clutch_id == clutch_id).values(states_sum=states_sum))
    fill(connection, "clutch")
