"""The program's locks in a database: of who writes, and of who serves while nobody migrates.

Source: https://www.postgresql.org/docs/current/explicit-locking.html#ADVISORY-LOCKS. Such locks are of one database, and end
with the transaction or the session that took them.
"""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import URL, Connection, Engine, event, text
from sqlalchemy.pool import ConnectionPoolEntry

from storage.engine.errors import DatabaseBusy, ServiceRuns
from storage.engine.postgresql.connect import make_engine, shown
from storage.engine.postgresql.driver_errors import LOCK_NOT_FREE, translated

#: The keys of the program's locks: "CLUTCH" in ASCII, and a number.
_PROGRAM = int.from_bytes(b"CLUTCH") << 8
WRITE_KEY, SERVICE_KEY = _PROGRAM | 1, _PROGRAM | 2
#: The class of the locks of single things, beside which each has a hash of its name: keys of two numbers are others than of
#: one. Two things of the same hash wait for each other, which harms nothing.
_OF_ONE = int.from_bytes(b"CLUT")

_lock_all = text(f"SELECT pg_advisory_xact_lock({WRITE_KEY})")
_lock_one = text(f"SELECT pg_advisory_xact_lock_shared({WRITE_KEY}), pg_advisory_xact_lock({_OF_ONE}, :hash)")


def write_lock(connection: Connection, of: str | None) -> None:
    """Have the transaction wait until it is the only one that writes `of` something, or at all, and remain so to its end."""
    if of is None:
        connection.execute(_lock_all)
    else:
        hashed = int.from_bytes(hashlib.sha256(of.encode("utf-8", "surrogateescape")).digest()[:4], signed=True)
        connection.execute(_lock_one, {"hash": hashed})


def hold_service_lock(engine: Engine, name: str) -> None:
    """Have every connection of a service hold the services' lock, which many may: also those that are made after the server
    was started again. Raises DatabaseBusy from then on where a migration takes longer than a connection waits for locks."""

    @event.listens_for(engine, "connect")
    def hold(connection: Any, _: ConnectionPoolEntry) -> None:
        try:
            connection.execute(f"SELECT pg_advisory_lock_shared({SERVICE_KEY})")
            connection.commit()
        except Exception as error:
            if getattr(error, "sqlstate", None) == LOCK_NOT_FREE:
                raise DatabaseBusy(f"{name}: the database is being migrated") from error
            raise


@contextmanager
def migration_lock(address: URL, lock_timeout: float) -> Iterator[None]:
    """Held inside: the lock under which no service runs. Raises ServiceRuns where one does not end within the time [s]."""
    name = shown(address)
    engine = make_engine(address, lock_timeout)
    try:
        with translated(name), engine.execution_options(isolation_level="AUTOCOMMIT").connect() as connection:
            try:
                with translated(name):
                    connection.exec_driver_sql(f"SELECT pg_advisory_lock({SERVICE_KEY})")
            except DatabaseBusy as error:
                raise ServiceRuns(f"{name}: a service uses this database: stop it first") from error
            try:
                yield
            finally:
                connection.invalidate()  # closed with its lock, and not asked before: its server may be gone
    finally:
        engine.dispose()
