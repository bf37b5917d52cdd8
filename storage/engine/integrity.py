"""Whether a database has the schema of this code."""

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection

from storage.engine.errors import DatabaseTooNew, DatabaseTooOld
from storage.migrations.upgrade import current, head, revisions
from storage.tables import metadata

#: What a server has beside the tables of `storage/tables.py`.
_SERVER_TABLES = ("commits", "shared_answer")


def refuse_newer(revision: str | None) -> None:
    """Raise DatabaseTooNew on a revision that this code does not know."""
    if revision is not None and revision not in revisions():
        raise DatabaseTooNew(
            f"the database is at revision {revision}, this release knows up to {head()}: use a newer one"
        )


def other_schema(connection: Connection) -> list[str]:
    """How the schema differs from this code's; empty where it does not. Raises DatabaseTooOld on an earlier revision's."""
    if current(connection) != head():
        raise DatabaseTooOld(
            f"the database is at revision {current(connection)}: its runs are checked at {head()} only, to which "
            "`clutchlife serve` brings it, with a copy of a file kept beside it"
        )
    own = _SERVER_TABLES if connection.dialect.name == "postgresql" else ()
    context = MigrationContext.configure(
        connection, opts={"include_object": lambda _, name, kind, *__: not (kind == "table" and name in own)}
    )
    return [f"the schema differs: {difference}" for difference in compare_metadata(context, metadata)]
