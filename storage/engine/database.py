"""The database: one SQLite file, many readers, one writer at a time.

The driver's own transaction control is switched off and every transaction is begun in so many words: readers by BEGIN,
writers by BEGIN IMMEDIATE, so that a writer either has the lock before its first statement or has done nothing.

Source: https://docs.sqlalchemy.org/en/20/dialects/sqlite.html (transactions with the pysqlite driver),
https://www.sqlite.org/wal.html (the WAL-reset bug, mended in 3.51.3).
"""

import math
import shutil
import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from sqlalchemy import URL, Connection, Engine, create_engine, event
from sqlalchemy.pool import ConnectionPoolEntry, NullPool, QueuePool

from storage.engine.backup import copy
from storage.engine.driver_errors import translated
from storage.engine.errors import DatabaseBusy, StorageError, StorageUnavailable
from storage.migrations.upgrade import current, head, upgrade

#: Seconds that a writer waits for the lock before it gives up.
LOCK_TIMEOUT = 10.0
#: Bytes that must be free on the disk: less, and a run of any size may no longer be taken.
LEAST_FREE = 16 << 20
#: Seconds between two attempts to change the journal mode.
_MODE_RETRY = 0.02


def preferred_journal_mode(sqlite_version: tuple[int, ...]) -> str:
    """The journal mode for a release of SQLite: "wal" from 3.51.3 on, before it "delete", the rollback journal.

    Older releases can lose a commit when two processes reset a write-ahead log at the same moment.
    """
    return "wal" if sqlite_version >= (3, 51, 3) else "delete"


def open_database(url: str, *, lock_timeout: float = LOCK_TIMEOUT) -> "Database":
    """Open `sqlite:///path` (`sqlite:////path` where it is absolute), make the file and run the migrations it lacks.

    Raises ValueError on another scheme or a database in memory, DatabaseTooNew on the file of a newer release,
    StorageUnavailable where the file cannot be used, DatabaseBusy where others hold it for `lock_timeout` [s].
    """
    path = path_of(url)
    with translated(path):
        mode = _set_journal_mode(path, preferred_journal_mode(sqlite3.sqlite_version_info), lock_timeout)
        _migrate(path, lock_timeout)
    return Database(path, journal_mode=mode, lock_timeout=lock_timeout)


class Database:
    """An open database. Threads share it; `close` it at the end. Made by `open_database`."""

    def __init__(self, path: Path, *, journal_mode: str, lock_timeout: float) -> None:
        self.path = path
        self.journal_mode = journal_mode
        self._lock_timeout = lock_timeout
        self._writers_turn = threading.Lock()
        self._turns: dict[str, threading.Lock] = {}
        self._turns_lock = threading.Lock()
        self._closed = False
        self._readers = _engine(path, lock_timeout)
        self._writers = self._readers.execution_options(begin="BEGIN IMMEDIATE")
        self._watching = threading.Lock()
        with translated(path):
            self._watcher = sqlite3.connect(path, timeout=lock_timeout, isolation_level=None, check_same_thread=False)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection that sees one state of the database until the block ends. Keep it short: commits wait for it."""
        self._refuse_closed()
        with translated(self.path), self._readers.begin() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A connection that holds the write lock: committed when the block ends, rolled back on any exception.

        Raises DatabaseBusy where the lock is not had in time, StorageUnavailable where the file cannot be written.
        """
        self._refuse_closed()
        if not self._writers_turn.acquire(timeout=self._lock_timeout):
            raise DatabaseBusy(
                f"another writer of this process held the database for more than {self._lock_timeout:g} s"
            )
        try:
            with translated(self.path), self._writers.begin() as connection:
                yield connection
        finally:
            self._writers_turn.release()

    @contextmanager
    def turn(self, name: str) -> Iterator[None]:
        """One thread of this process at a time for a name: who would compute the same results at once waits instead.

        No lock of the database is held meanwhile.
        """
        with self._turns_lock:
            turn = self._turns.setdefault(name, threading.Lock())
        with turn:
            yield

    def version(self) -> int:
        """A number that is another after every commit, whichever process made it; it means nothing but to this object.

        Taken before a reading, it says later whether that reading would still find the same.
        """
        self._refuse_closed()
        with translated(self.path), self._watching:
            # fetched to the end: an open statement would hold up commits
            ((found,),) = self._watcher.execute("PRAGMA data_version").fetchall()
        return int(found)

    def ready(self) -> bool:
        """Whether the file is still there, answers at the code's revision, and could be written. Writes nothing to stay."""
        try:
            with self.reading() as connection:
                answers = self.path.exists() and current(connection) == head()
            return answers and shutil.disk_usage(self.path.parent).free >= LEAST_FREE and _writable(self.path)
        except (StorageError, OSError):
            return False

    def backup(self, path: Path) -> None:
        """A consistent copy at `path` while others read and write. Raises FileExistsError where `path` exists."""
        self._refuse_closed()
        with translated(self.path):
            copy(self.path, path, lock_timeout=self._lock_timeout)

    def close(self) -> None:
        """Close all connections; what is asked afterwards raises StorageUnavailable. Twice is once."""
        self._closed = True
        with self._watching:
            self._watcher.close()
        self._readers.dispose()

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"the database {self.path} has been closed")


def _writable(path: Path) -> bool:
    """Whether a transaction may begin to write the first page; it is taken back. One that another writer holds up, may."""
    try:
        address = f"{path.resolve().as_uri()}?mode=rw"
        with closing(sqlite3.connect(address, uri=True, timeout=0.0, isolation_level=None)) as connection:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(f"PRAGMA user_version={connection.execute('PRAGMA user_version').fetchone()[0]}")
            connection.execute("ROLLBACK")
    except sqlite3.Error as error:
        return getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY
    return True


def path_of(url: str) -> Path:
    """The file of `sqlite:///path`; ValueError on anything else."""
    scheme, separator, rest = url.partition("://")
    if not separator or scheme != "sqlite":
        raise ValueError(
            f"the database must be given as sqlite:///path, got the scheme {scheme if separator else ''!r}"
        )
    path = rest.removeprefix("/")
    if not rest.startswith("/") or not path or path.startswith(":memory:"):
        raise ValueError(f"a database needs a file, as in sqlite:///clutchlife.db, got {url!r}")
    if "?" in path or path.startswith("file:"):
        raise ValueError(f"a database is given by its path alone, without options, got {url!r}")
    return Path(path)


def _engine(path: Path, lock_timeout: float, *, foreign_keys: bool = True, pooled: bool = True) -> Engine:
    url = URL.create("sqlite+pysqlite", database=str(path))
    arguments = {"timeout": lock_timeout, "check_same_thread": False}
    if pooled:
        # No upper bound: a connection is cheap, and the threads that ask for one are bounded elsewhere.
        engine = create_engine(url, connect_args=arguments, poolclass=QueuePool, pool_size=8, max_overflow=-1)
    else:
        engine = create_engine(url, connect_args=arguments, poolclass=NullPool)

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _: ConnectionPoolEntry) -> None:
        connection.isolation_level = None
        connection.execute(f"PRAGMA foreign_keys={'ON' if foreign_keys else 'OFF'}")
        connection.execute("PRAGMA synchronous=FULL")
        # A transaction larger than the cache would lock readers out before it commits.
        connection.execute("PRAGMA cache_spill=OFF")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        connection.exec_driver_sql(connection.get_execution_options().get("begin", "BEGIN"))

    return engine


def _set_journal_mode(path: Path, wanted: str, lock_timeout: float) -> str:
    """Set the mode where it differs; the file remembers "wal", "delete" is the default. Returns the mode in force."""
    # SQLite does not wait where two change the mode at once, since they would wait for each other: so try again here.
    for attempts_left in reversed(range(math.ceil(lock_timeout / _MODE_RETRY) + 1)):
        try:
            mode = _try_journal_mode(path, wanted)
            break
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or not attempts_left:
                raise
            time.sleep(_MODE_RETRY)
    if mode not in {wanted, "delete"}:
        raise StorageUnavailable(
            f"{path} is in journal mode {mode}, which this SQLite must not use, and cannot leave it"
        )
    return mode


def _try_journal_mode(path: Path, wanted: str) -> str:
    with closing(sqlite3.connect(path, timeout=0.0, isolation_level=None)) as connection:
        mode = str(connection.execute("PRAGMA journal_mode").fetchone()[0])
        if mode != wanted:
            mode = str(connection.execute(f"PRAGMA journal_mode={wanted}").fetchone()[0])
    return mode


def _migrate(path: Path, lock_timeout: float) -> None:
    """Run the missing steps in one immediate transaction: of two processes that start at once, one waits."""
    # A step may rebuild a table that others refer to, so keys are checked once at the end.
    engine = _engine(path, lock_timeout, foreign_keys=False, pooled=False)
    with engine.begin() as connection:
        if current(connection) == head():
            return
    with engine.execution_options(begin="BEGIN IMMEDIATE").begin() as connection:
        upgrade(connection)
        broken = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
        if broken:
            raise StorageUnavailable(f"{path} holds rows that refer to nothing: {broken[:5]}")
