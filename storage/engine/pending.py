"""The mark of a database that is being filled from another one: a table with the source's name in its one row."""

from sqlalchemy import Column, Connection, MetaData, Table, inspect, select

from storage.dialects import TEXT
from storage.engine.errors import UnfinishedMigration

_own = MetaData()
_pending = Table("migration_pending", _own, Column("source", TEXT, primary_key=True))


def pending(connection: Connection) -> str | None:
    """The source that the database is being filled from; None where it is complete."""
    if not inspect(connection).has_table(_pending.name):
        return None
    return str(connection.execute(select(_pending.c.source)).scalar_one())


def mark(connection: Connection, source: str) -> None:
    """From now on the database is incomplete."""
    _own.create_all(connection)
    connection.execute(_pending.insert(), {"source": source})


def release(connection: Connection) -> None:
    """The database is complete."""
    _own.drop_all(connection)


def refuse_pending(connection: Connection) -> None:
    """Raise UnfinishedMigration where the database is incomplete."""
    source = pending(connection)
    if source is not None:
        raise UnfinishedMigration(
            f"a migration from {source} into this database has not ended: give `clutchlife migrate` once more"
        )
