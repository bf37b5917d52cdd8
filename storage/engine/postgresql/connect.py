"""How the server is reached: its address, the settings of every connection, its errors as the store's own, its locks.

Beside transactions stand `SingleStatements`: what a service asks with every request, and what services share.
Advisory locks are of one database, and end with the transaction or the session that took them: of who writes, and of who
serves while nobody migrates. The driver itself is loaded when a connection is made.

Source: https://docs.sqlalchemy.org/en/20/dialects/postgresql.html (psycopg),
https://www.postgresql.org/docs/current/runtime-config-client.html, .../errcodes-appendix.html, .../explicit-locking.html.
"""

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from typing import Any

import sqlalchemy as sa
from sqlalchemy.exc import ArgumentError, DataError, DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.pool import ConnectionPoolEntry

from storage.engine.database import translated_by
from storage.engine.errors import (
    DamagedData,
    DatabaseBusy,
    ServiceRuns,
    StorageError,
    StorageUnavailable,
    UnstorableText,
)

#: A lock that was not free in time, a serialization failure, a deadlock, and too many connections.
LOCK_NOT_FREE = "55P03"
_BUSY = {
    LOCK_NOT_FREE: "another request held the database for too long",
    "40001": "another request changed the same data at the same time",
    "40P01": "another request changed the same data at the same time",
    "53300": "the server has no free connection",
}
_READ_ONLY = "25006"
#: A text that is no value of the type as which it is read.
_NO_VALUE = "22P02"
#: Classes of codes: connections, passwords, unknown databases, means of the server, its operator, its disk, its faults.
_UNAVAILABLE = ("08", "28", "3D", "53", "57", "58", "XX")


def translated(name: str) -> AbstractContextManager[None]:
    """Context that raises errors of driver and pool as the storage's own, which name the database."""
    return translated_by(partial(_store_error, name), (PoolTimeoutError, DBAPIError))


def _store_error(name: str, error: Exception) -> StorageError | None:
    if not isinstance(error, DBAPIError):
        return DatabaseBusy(f"{name}: no free connection ({error})")
    code: str | None = getattr(error.orig, "sqlstate", None)
    reason = " ".join(str(error.orig).split())
    if code in _BUSY:
        return DatabaseBusy(f"{name}: {_BUSY[code]} ({reason})")
    if code == _READ_ONLY:
        return StorageUnavailable(f"{name}: the database is read-only ({reason})")
    if isinstance(error, DataError) and "NUL" in reason:
        return UnstorableText("text must not hold the character NUL (U+0000), which PostgreSQL cannot store")
    if code == _NO_VALUE and "type json" in reason:
        return DamagedData("the database holds JSON that is none")
    # a connection that was refused or has broken has no code
    if error.connection_invalidated or code is None or code.startswith(_UNAVAILABLE):
        return StorageUnavailable(f"{name}: the server cannot be used ({reason})")
    return None


SCHEME = "postgresql+psycopg"
#: Connections that a process keeps, and how many more it makes for a while. Chosen: a service's threads seldom ask at once,
#: and with its eight other processes it stays well under the 100 connections that a server has by default.
_KEPT, _MORE = 4, 12
#: What libpq is told where the address does not say: how long [s] a connection may take to be made, after how long [ms] a
#: server whose machine is lost counts as gone, and how often [s] one that says nothing is asked. Chosen; no table.
_CONNECTION = {"connect_timeout": 10, "keepalives_idle": 30, "keepalives_interval": 10, "tcp_user_timeout": 60_000}
#: Settings of every session. Where the machine of a writer is lost, the server notices within a minute and ends its
#: transaction, and with it the lock. What is acknowledged is on the disk, unless a server promises more (replicas).
_SESSION = """
SELECT set_config('lock_timeout', '{lock_timeout:d}', false),
       set_config('tcp_keepalives_idle', '30', false),
       set_config('tcp_keepalives_interval', '10', false),
       set_config('tcp_keepalives_count', '3', false),
       set_config('tcp_user_timeout', '60000', false),
       CASE WHEN current_setting('synchronous_commit') = 'off' THEN set_config('synchronous_commit', 'on', false) END
"""


def is_on_server(url: str) -> bool:
    """Whether an address is that of a database on a server."""
    return url.startswith(f"{SCHEME}://")


def address_of(url: str) -> sa.URL:
    """The parsed address; ValueError, without the password, if a part is missing or wrong."""
    try:
        address = sa.make_url(url)
    except (ArgumentError, ValueError):
        raise ValueError(f"the database must be given as {SCHEME}://user@host/database") from None
    if "@" in (address.host or ""):
        raise ValueError("an @ in a password must be written as %40 in the database's address")
    if not address.database:
        raise ValueError(f"the database needs a name, as in {SCHEME}://user@host/database")
    return address


def shown(address: sa.URL) -> str:
    """The address for logs and errors: without the password and the options, one of which may be a password."""
    place = address.host or "local socket"
    return f"PostgreSQL database {address.database} ({place}{'' if address.port is None else f':{address.port}'})"


def make_engine(address: sa.URL, lock_timeout: float) -> sa.Engine:
    """An engine for the database. Raises StorageUnavailable if the driver is not installed."""
    # a server that was started again has ended the connections that were kept
    return _engine(address, lock_timeout, pool_size=_KEPT, max_overflow=_MORE, pool_pre_ping=True)


def make_autocommit_engine(address: sa.URL, lock_timeout: float, *, connections: int) -> sa.Engine:
    """An engine for single statements with this many permanent connections, without transactions or connection checks:
    each would cost a round trip to the server."""
    return _engine(address, lock_timeout, pool_size=connections, max_overflow=0, isolation_level="AUTOCOMMIT")


def _engine(address: sa.URL, lock_timeout: float, **options: Any) -> sa.Engine:
    unsaid = {name: value for name, value in _CONNECTION.items() if name not in address.query}
    try:
        engine = sa.create_engine(address, connect_args=unsaid, pool_timeout=lock_timeout, **options)
    except ModuleNotFoundError as error:
        raise StorageUnavailable("PostgreSQL needs a driver: pip install clutchlife[postgresql]") from error
    session = _SESSION.format(lock_timeout=max(1, round(1000 * lock_timeout)))

    @sa.event.listens_for(engine, "connect")
    def prepare(connection: Any, _: ConnectionPoolEntry) -> None:
        connection.execute(session)
        connection.commit()

    return engine


server_tables = sa.MetaData()
#: One row: how many transactions that changed something were committed. Each raises it as its last statement, while it alone
#: writes, so that who reads a number also sees all that was committed up to it; the numbers of a sequence do not promise it.
#: PostgreSQL's alone: SQLite has `PRAGMA data_version`.
commits = sa.Table("commits", server_tables, sa.Column("number", sa.BigInteger, primary_key=True, autoincrement=False))
count_commit = sa.update(commits).values(number=commits.c.number + 1)


class SingleStatements:
    """Runs single statements outside transactions; threads share it. `engine` is one of
    `connect.make_autocommit_engine`, `name` the database's name in errors."""

    def __init__(self, engine: sa.Engine, name: str) -> None:
        self._engine = engine
        self._name = name
        self._closed = False

    def rows(self, statement: sa.Executable, values: dict[str, Any]) -> Sequence[sa.RowMapping]:
        """The rows that a statement returns, if any. After a lost connection it is run once more.

        Raises StorageUnavailable where the server cannot be reached, or when this was closed, and DatabaseBusy where no
        connection is free in time.
        """
        self._refuse_closed()
        with translated(self._name):
            try:
                return self._run(statement, values)
            except DBAPIError as error:
                if not error.connection_invalidated:
                    raise
            # the server was started again: the connections of before have been dropped
            self._refuse_closed()
            return self._run(statement, values)

    def close(self) -> None:
        """Close the connections; any later use raises StorageUnavailable. May be called twice."""
        self._closed = True
        self._engine.dispose()

    def _run(self, statement: sa.Executable, values: dict[str, Any]) -> Sequence[sa.RowMapping]:
        with self._engine.connect() as connection:
            result = connection.execute(statement, values)
            return result.mappings().all() if result.returns_rows else ()

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self._name} has been closed")


#: The keys of the program's locks: "CLUTCH" in ASCII, and a number.
_PROGRAM = int.from_bytes(b"CLUTCH") << 8
WRITE_KEY, SERVICE_KEY = _PROGRAM | 1, _PROGRAM | 2
#: The class of the locks of single things, beside which each has a hash of its name: keys of two numbers are others than of
#: one. Two things of the same hash wait for each other, which harms nothing.
_OF_ONE = int.from_bytes(b"CLUT")

_lock_all = sa.text(f"SELECT pg_advisory_xact_lock({WRITE_KEY})")
_lock_one = sa.text(f"SELECT pg_advisory_xact_lock_shared({WRITE_KEY}), pg_advisory_xact_lock({_OF_ONE}, :hash)")


def write_lock(connection: sa.Connection, of: str | None) -> None:
    """Wait until the transaction is the only one that writes `of` something (None: at all), until its end."""
    if of is None:
        connection.execute(_lock_all)
    else:
        hashed = int.from_bytes(hashlib.sha256(of.encode("utf-8", "surrogateescape")).digest()[:4], signed=True)
        connection.execute(_lock_one, {"hash": hashed})


def hold_service_lock(engine: sa.Engine, name: str) -> None:
    """Have every connection of a service hold the services' shared lock, including connections made after a restart of
    the server. Raises DatabaseBusy from then on if a migration takes longer than a connection waits for locks."""

    @sa.event.listens_for(engine, "connect")
    def hold(connection: Any, _: ConnectionPoolEntry) -> None:
        try:
            connection.execute(f"SELECT pg_advisory_lock_shared({SERVICE_KEY})")
            connection.commit()
        except Exception as error:
            if getattr(error, "sqlstate", None) == LOCK_NOT_FREE:
                raise DatabaseBusy(f"{name}: the database is being migrated") from error
            raise


@contextmanager
def migration_lock(address: sa.URL, lock_timeout: float) -> Iterator[None]:
    """Context that holds the lock under which no service runs. Raises ServiceRuns if a service does not end within this
    time [s]."""
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
