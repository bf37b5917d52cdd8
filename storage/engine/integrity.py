"""Whether a database has the schema of this code."""

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection

from storage.engine.errors import DatabaseTooOld
from storage.migrations.upgrade import current, head
from storage.tables import metadata


def other_schema(connection: Connection) -> list[str]:
    """How the schema differs from this code's; empty where it does not. Raises DatabaseTooOld on an earlier revision's."""
    if current(connection) != head():
        raise DatabaseTooOld(
            f"the database is at revision {current(connection)}: its runs are checked at {head()} only, to which "
            "`clutchlife serve` brings it, with a copy kept beside it"
        )
    differences = compare_metadata(MigrationContext.configure(connection), metadata)
    return [f"the schema differs: {difference}" for difference in differences]
