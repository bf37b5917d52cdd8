"""The tables of release 1.0.0: where later steps begin.

An empty database is not brought here: it gets all of today's tables at once (`storage.migrations.upgrade`).
"""

revision = "s0001_first_tables"
down_revision: str | None = None


def upgrade() -> None:
    """Nothing: whatever is at this revision has the tables."""
