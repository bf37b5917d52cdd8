"""Whether a database has the schema of this code, and is complete: one that is being filled from another is marked by a
table with the source's name in its one row.
"""

from sqlalchemy import Column, Connection, MetaData, Table, inspect, select

from storage.dialects import TEXT
from storage.engine.errors import DatabaseTooNew, DatabaseTooOld, UnfinishedMigration
from storage.migrations.upgrade import current, head, revisions
from storage.tables import metadata

#: What a server has beside the tables of `storage/tables.py`.
_SERVER_TABLES = ("commits", "shared_answer")


def refuse_newer(revision: str | None) -> None:
    """Raise DatabaseTooNew if this code does not know the revision."""
    if revision is not None and revision not in revisions():
        raise DatabaseTooNew(
            f"the database is at revision {revision}, this release knows only up to {head()}: use a newer release"
        )


def other_schema(connection: Connection) -> list[str]:
    """The differences between the database's schema and this code's; empty if there are none. Raises DatabaseTooOld at
    an earlier revision."""
    from alembic.autogenerate import compare_metadata  # start-up time: only `verify` compares schemas
    from alembic.migration import MigrationContext  # start-up time

    if current(connection) != head():
        raise DatabaseTooOld(
            f"the database is at revision {current(connection)}: its runs can be checked only at {head()}. "
            "`clutchlife serve` migrates it, and keeps a copy of an SQLite file"
        )
    server_tables = _SERVER_TABLES if connection.dialect.name == "postgresql" else ()
    context = MigrationContext.configure(
        connection, opts={"include_object": lambda _, name, kind, *__: not (kind == "table" and name in server_tables)}
    )
    return [f"the schema differs: {difference}" for difference in compare_metadata(context, metadata)]


_own = MetaData()
_pending = Table("migration_pending", _own, Column("source", TEXT, primary_key=True))


def pending(connection: Connection) -> str | None:
    """The source from which the database is being filled; None if it is complete."""
    if not inspect(connection).has_table(_pending.name):
        return None
    return str(connection.execute(select(_pending.c.source)).scalar_one())


def mark(connection: Connection, source: str) -> None:
    """Mark the database as incomplete."""
    _own.create_all(connection)
    connection.execute(_pending.insert(), {"source": source})


def release(connection: Connection) -> None:
    """Mark the database as complete."""
    _own.drop_all(connection)


def refuse_pending(connection: Connection) -> None:
    """Raise UnfinishedMigration if the database is incomplete."""
    source = pending(connection)
    if source is not None:
        raise UnfinishedMigration(
            f"a migration from {source} into this database is not finished: run `clutchlife migrate` again"
        )
