"""Opens the SQLite file: its permissions, journal, connection settings and locks.

Files are private from the moment they are made: they hold what keys protect. SQLite gives its log, and the index of its
log, the mode of the database file; a file that is there keeps its mode. The driver's own transaction control is switched
off: `database.py` begins every transaction explicitly.

One writer at a time, among the threads of this process and among processes, by a lock beside the file (`FILE-lock`): SQLite
before 3.51.3 may lose commits of a write-ahead log where one connection checkpoints while another commits
(https://www.sqlite.org/wal.html, "the WAL-reset bug"). Every write transaction, with the checkpoint that its commit may run,
is made under this lock, so that no two ever meet. Readers do not take it.
One service of a file at a time (`FILE-service`): a second one would take the first one's diagnoses for those of a service
that has died. Commands hold that lock only while they change what every service relies on: the schema, or the whole file.

Source: https://docs.sqlalchemy.org/en/20/dialects/sqlite.html (transactions with the pysqlite driver),
https://www.sqlite.org/wal.html, https://www.sqlite.org/rescode.html (the low byte of a result code is its class).
"""

import fcntl
import math
import os
import re
import sqlite3
import threading
import time
import weakref
from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from sqlalchemy.pool import ConnectionPoolEntry, NullPool, QueuePool

from storage.engine.database import translated_by
from storage.engine.errors import DamagedData, DatabaseBusy, ServiceRuns, StorageError, StorageUnavailable

#: Its owner reads and writes, nobody else does either.
MODE = 0o600


def make_new(path: Path) -> None:
    """Create an empty file. Raises FileExistsError if the path exists."""
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, MODE))


def make_if_missing(path: Path) -> None:
    """Create an empty file unless the path exists."""
    with suppress(FileExistsError):
        make_new(path)


_BUSY = {sqlite3.SQLITE_BUSY: "the database is locked", sqlite3.SQLITE_LOCKED: "a table of the database is locked"}
_UNAVAILABLE = {
    sqlite3.SQLITE_FULL: "the database or its disk is full",
    sqlite3.SQLITE_READONLY: "the database is read-only",
    sqlite3.SQLITE_CANTOPEN: "the database file cannot be opened",
    sqlite3.SQLITE_PERM: "access to the database file is denied",
    sqlite3.SQLITE_IOERR: "reading or writing the database file failed",
    sqlite3.SQLITE_CORRUPT: "the database file is damaged",
    sqlite3.SQLITE_NOTADB: "the file is not a database",
}
#: What SQLite says where it is to read a value in a text that is no JSON; the code is that of any mistake.
_NO_JSON = "malformed JSON"

#: Everything that driver and pool raise.
DRIVER_ERRORS = (PoolTimeoutError, DBAPIError, sqlite3.Error)


def _store_error(path: Path, error: Exception) -> StorageError | None:
    if isinstance(error, PoolTimeoutError):
        return DatabaseBusy(f"{path}: no free connection ({error})")
    origin = error.orig if isinstance(error, DBAPIError) else error
    code = getattr(origin, "sqlite_errorcode", None)
    if code is None and "decode" in str(origin):  # text that is none: the driver gives it no code
        return DamagedData(f"the database holds text that is none: {str(origin).partition(' with text')[0]}")
    if str(origin) == _NO_JSON:
        return DamagedData("the database holds JSON that is none")
    if code is None:
        return None
    primary = code & 0xFF
    if primary in _BUSY:
        return DatabaseBusy(f"{path}: {_BUSY[primary]} ({origin})")
    if primary in _UNAVAILABLE:
        return StorageUnavailable(f"{path}: {_UNAVAILABLE[primary]} ({origin})")
    return None


#: Write-ahead logging: readers and a commit do not wait for each other.
JOURNAL_MODE = "wal"
#: Seconds between two attempts to change the journal mode.
_MODE_RETRY = 0.02


def path_of(url: str) -> Path:
    """The file path in `sqlite:///path`; ValueError on any other address."""
    scheme, separator, remainder = url.partition("://")
    if not separator or scheme != "sqlite":
        raise ValueError(
            f"the database must be given as sqlite:///path, got the scheme {scheme if separator else ''!r}"
        )
    path = remainder.removeprefix("/")
    if not remainder.startswith("/") or not path or path.startswith(":memory:"):
        raise ValueError("a database needs a file, as in sqlite:///clutchlife.db")  # the address may hold a password
    if "?" in path or path.startswith("file:"):
        shown = re.sub(r"\?.*", "?...", url)  # an option may be a password
        raise ValueError(f"a database is given by its path alone, without options, got {shown!r}")
    return Path(path)


def wanted_journal_mode(path: Path, lock_timeout: float) -> str | None:
    """JOURNAL_MODE if the file is in it already, else None; read without changing it."""
    with closing(sqlite3.connect(path, timeout=lock_timeout, isolation_level=None)) as connection:
        return JOURNAL_MODE if _mode(connection) == JOURNAL_MODE else None


def found_journal_mode(path: Path, lock_timeout: float) -> str:
    """The journal mode of an existing file, read without changing it."""
    with closing(connect_shared(path, lock_timeout, writable=False)) as connection:
        return _mode(connection)


def set_journal_mode(path: Path, lock_timeout: float) -> str:
    """Set the file's journal mode to JOURNAL_MODE; returns the mode in force.

    A file on a volume that cannot share memory between processes stays with its rollback journal, "delete".
    Call it under the `WriteLock`. Raises StorageUnavailable where the file is in some third mode.
    """
    # SQLite does not wait where others use the file while its mode is changed: so try again here.
    for attempts_left in reversed(range(math.ceil(lock_timeout / _MODE_RETRY) + 1)):
        try:
            with closing(sqlite3.connect(path, timeout=0.0, isolation_level=None)) as connection:
                mode = _mode(connection)
                if mode != JOURNAL_MODE:
                    mode = str(connection.execute(f"PRAGMA journal_mode={JOURNAL_MODE}").fetchone()[0])
            break
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or not attempts_left:
                raise
            time.sleep(_MODE_RETRY)
    if mode not in {"wal", "delete"}:
        raise StorageUnavailable(f"{path} is in journal mode {mode} and cannot leave it")
    return mode


def _mode(connection: sqlite3.Connection) -> str:
    return str(connection.execute("PRAGMA journal_mode").fetchone()[0])


def read_only(path: Path) -> str:
    """The file's URI for read-only connections, which never create the file or write back its log."""
    return f"{path.absolute().as_uri()}?mode=ro"


class _Connection(sqlite3.Connection):
    """A connection that can end statements whose results were not read to the end.

    SQLite keeps the state of the database that such a statement began to read, beyond the end of its transaction: the
    next transaction of the connection would read old rows. An error in the middle of a result leaves one for as long as
    anything holds the error.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._cursors: weakref.WeakSet[sqlite3.Cursor] = weakref.WeakSet()

    def cursor(self, *arguments: Any, **options: Any) -> Any:
        cursor = super().cursor(*arguments, **options)
        self._cursors.add(cursor)
        return cursor

    def end_statements(self) -> None:
        while self._cursors:
            self._cursors.pop().close()


def connect_shared(path: Path, lock_timeout: float, *, writable: bool) -> _Connection:
    """A driver connection that threads may share. Transactions on it begin only by an explicit statement."""
    address, uri = (str(path), False) if writable else (read_only(path), True)
    return _Connection(address, uri=uri, timeout=lock_timeout, isolation_level=None, check_same_thread=False)


def make_engine(
    path: Path, lock_timeout: float, *, foreign_keys: bool = True, pooled: bool = True, writable: bool = True
) -> Engine:
    """An engine for the file, with the settings of every connection. Its user begins each transaction by a statement."""
    connect = partial(connect_shared, path, lock_timeout, writable=writable)
    # No upper bound: a connection is cheap, and the threads that use one are bounded elsewhere.
    pool = {"poolclass": QueuePool, "pool_size": 8, "max_overflow": -1} if pooled else {"poolclass": NullPool}
    engine = create_engine("sqlite+pysqlite://", creator=connect, **pool)

    @event.listens_for(engine, "reset")
    def end_statements(connection: _Connection, *_: object) -> None:
        connection.end_statements()

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _: ConnectionPoolEntry) -> None:
        connection.execute(f"PRAGMA foreign_keys={'ON' if foreign_keys else 'OFF'}")
        connection.execute("PRAGMA synchronous=FULL")
        # A transaction larger than the cache would lock readers out before it commits.
        connection.execute("PRAGMA cache_spill=OFF")

    return engine


#: [s] Between two attempts to take the lock from another process: first and longest. Chosen: a commit takes 1 to 5 ms.
_FIRST_RETRY, _LONGEST_RETRY = 0.0005, 0.005


class WriteLock:
    """The lock of one database file, `FILE-lock`, held by every process that writes the file. `close` it at the end."""

    def __init__(self, path: Path, timeout: float) -> None:
        self._path = path.with_name(f"{path.name}-lock")
        self._timeout = timeout
        self._thread_lock = threading.Lock()
        self._file: int | None = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Context that holds the lock.

        Raises DatabaseBusy if it is not free in time, StorageUnavailable if its file cannot be created.
        """
        deadline = time.monotonic() + self._timeout
        if not self._thread_lock.acquire(timeout=self._timeout):
            raise DatabaseBusy(f"another request held the database for more than {self._timeout:g} s")
        try:
            if self._file is None:
                self._file = _lock_file(self._path)
            file = self._file
            self._take(file, deadline)
            try:
                yield
            finally:
                fcntl.flock(file, fcntl.LOCK_UN)
        finally:
            self._thread_lock.release()

    def close(self) -> None:
        """Close the file. The lock may be held again afterwards."""
        with self._thread_lock:
            if self._file is not None:
                os.close(self._file)
                self._file = None

    def _take(self, file: int, deadline: float) -> None:
        pause = _FIRST_RETRY
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise DatabaseBusy(
                        f"{self._path}: another process held the database for more than {self._timeout:g} s"
                    ) from None
                time.sleep(pause)
                pause = min(2 * pause, _LONGEST_RETRY)
            else:
                return


@contextmanager
def service_lock(path: Path) -> Iterator[None]:
    """Context that holds the service's lock of the database at `path`.

    Raises ServiceRuns if another holds it, StorageUnavailable if its file cannot be created.
    """
    lock_file = path.with_name(f"{path.name}-service")
    with open(_lock_file(lock_file), "rb+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = file.read(20).decode(errors="replace").strip()
            raise ServiceRuns(
                f"{path}: a service uses this database already (process {holder or 'unknown'}): stop it first"
            ) from None
        file.truncate(0)
        file.write(str(os.getpid()).encode())
        file.flush()
        yield


def _lock_file(path: Path) -> int:
    try:
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, MODE)
    except OSError as error:
        raise StorageUnavailable(f"{path}: the lock of the database cannot be opened ({error})") from error


def translated(path: Path) -> AbstractContextManager[None]:
    """Context that raises errors of driver and pool as the storage's own, which name the file."""
    return translated_by(partial(_store_error, path), DRIVER_ERRORS)


@contextmanager
def transaction(engine: Engine, begin: str) -> Iterator[Connection]:
    """Context with a connection in a transaction begun by the statement `begin`: committed at the end, or rolled back."""
    with engine.begin() as connection:
        connection.exec_driver_sql(begin)
        yield connection
