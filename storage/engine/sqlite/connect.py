"""How the file is opened: its path from the URL, its journal mode, and the settings of every connection.

The driver's own transaction control is switched off: `transactions.py` begins every transaction explicitly.

Source: https://docs.sqlalchemy.org/en/20/dialects/sqlite.html (transactions with the pysqlite driver),
https://www.sqlite.org/wal.html; why any release of SQLite may use the log here: `write_lock`.
"""

import math
import re
import sqlite3
import time
from contextlib import closing
from functools import partial
from pathlib import Path

from sqlalchemy import Engine, create_engine, event
from sqlalchemy.pool import ConnectionPoolEntry, NullPool, QueuePool

from storage.engine.errors import StorageUnavailable

#: Write-ahead logging: readers and a commit do not wait for each other.
JOURNAL_MODE = "wal"
_DIALECT = "sqlite+pysqlite://"
#: Seconds between two attempts to change the journal mode.
_MODE_RETRY = 0.02


def path_of(url: str) -> Path:
    """The file of `sqlite:///path`; ValueError on anything else."""
    scheme, separator, rest = url.partition("://")
    if not separator or scheme != "sqlite":
        raise ValueError(
            f"the database must be given as sqlite:///path, got the scheme {scheme if separator else ''!r}"
        )
    path = rest.removeprefix("/")
    if not rest.startswith("/") or not path or path.startswith(":memory:"):
        raise ValueError("a database needs a file, as in sqlite:///clutchlife.db")  # the address may hold a password
    if "?" in path or path.startswith("file:"):
        shown = re.sub(r"\?.*", "?...", url)  # an option may be a password
        raise ValueError(f"a database is given by its path alone, without options, got {shown!r}")
    return Path(path)


def wanted_journal_mode(path: Path, lock_timeout: float) -> str | None:
    """JOURNAL_MODE where the file is in it already, None where it is not. Read without changing it."""
    with closing(sqlite3.connect(path, timeout=lock_timeout, isolation_level=None)) as connection:
        return JOURNAL_MODE if _mode(connection) == JOURNAL_MODE else None


def found_journal_mode(path: Path, lock_timeout: float) -> str:
    """The journal mode that an existing file is in, read without changing it."""
    with closing(connect_shared(path, lock_timeout, writable=False)) as connection:
        return _mode(connection)


def set_journal_mode(path: Path, lock_timeout: float) -> str:
    """Put the file into JOURNAL_MODE; returns the mode in force.

    A file on a volume that cannot share memory between processes stays with its rollback journal, "delete".
    Call it under the `WriteLock`. Raises StorageUnavailable where the file is in some third mode.
    """
    # SQLite does not wait where others use the file while its mode is changed: so try again here.
    for attempts_left in reversed(range(math.ceil(lock_timeout / _MODE_RETRY) + 1)):
        try:
            mode = _try_journal_mode(path)
            break
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or not attempts_left:
                raise
            time.sleep(_MODE_RETRY)
    if mode not in {"wal", "delete"}:
        raise StorageUnavailable(f"{path} is in journal mode {mode} and cannot leave it")
    return mode


def _try_journal_mode(path: Path) -> str:
    with closing(sqlite3.connect(path, timeout=0.0, isolation_level=None)) as connection:
        mode = _mode(connection)
        if mode != JOURNAL_MODE:
            mode = str(connection.execute(f"PRAGMA journal_mode={JOURNAL_MODE}").fetchone()[0])
    return mode


def _mode(connection: sqlite3.Connection) -> str:
    return str(connection.execute("PRAGMA journal_mode").fetchone()[0])


def read_only(path: Path) -> str:
    """The file's URI for connections that only read: they make no file where it is missing, and write back no log."""
    return f"{path.absolute().as_uri()}?mode=ro"


def connect_shared(path: Path, lock_timeout: float, *, writable: bool) -> sqlite3.Connection:
    """A connection of the driver that threads may share. Its transactions begin by statements alone."""
    address = str(path) if writable else read_only(path)
    return sqlite3.connect(
        address, uri=not writable, timeout=lock_timeout, isolation_level=None, check_same_thread=False
    )


def make_engine(
    path: Path, lock_timeout: float, *, foreign_keys: bool = True, pooled: bool = True, writable: bool = True
) -> Engine:
    """An engine on the file, with the settings of every connection. Its user begins each transaction by a statement."""
    connect = partial(connect_shared, path, lock_timeout, writable=writable)
    if pooled:
        # No upper bound: a connection is cheap, and the threads that use one are bounded elsewhere.
        engine = create_engine(_DIALECT, creator=connect, poolclass=QueuePool, pool_size=8, max_overflow=-1)
    else:
        engine = create_engine(_DIALECT, creator=connect, poolclass=NullPool)

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _: ConnectionPoolEntry) -> None:
        connection.execute(f"PRAGMA foreign_keys={'ON' if foreign_keys else 'OFF'}")
        connection.execute("PRAGMA synchronous=FULL")
        # A transaction larger than the cache would lock readers out before it commits.
        connection.execute("PRAGMA cache_spill=OFF")

    return engine
