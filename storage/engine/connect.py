"""How the file is opened: its path from the URL, its journal mode, and the settings of every connection.

The driver's own transaction control is switched off: `transactions.py` begins every transaction explicitly.

Source: https://docs.sqlalchemy.org/en/20/dialects/sqlite.html (transactions with the pysqlite driver),
https://www.sqlite.org/wal.html (the WAL-reset bug, fixed in 3.51.3).
"""

import math
import sqlite3
import time
from contextlib import closing
from pathlib import Path

from sqlalchemy import URL, Engine, create_engine, event
from sqlalchemy.pool import ConnectionPoolEntry, NullPool, QueuePool

from storage.engine.errors import StorageUnavailable

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
        raise ValueError(f"a database needs a file, as in sqlite:///clutchlife.db, got {url!r}")
    if "?" in path or path.startswith("file:"):
        raise ValueError(f"a database is given by its path alone, without options, got {url!r}")
    return Path(path)


def preferred_journal_mode(sqlite_version: tuple[int, ...]) -> str:
    """The journal mode for a release of SQLite: "wal" from 3.51.3 on, before it "delete", the rollback journal.

    Older releases can lose a commit when two processes reset a write-ahead log at the same moment.
    """
    return "wal" if sqlite_version >= (3, 51, 3) else "delete"


def set_journal_mode(path: Path, lock_timeout: float) -> str:
    """Set the mode that this SQLite prefers where the file is in another; returns the mode in force.

    The file itself records "wal"; "delete" is the default. Raises StorageUnavailable where the file cannot leave a mode
    that this SQLite must not use.
    """
    preferred = preferred_journal_mode(sqlite3.sqlite_version_info)
    # SQLite does not wait where two change the mode at once, since they would wait for each other: so try again here.
    for attempts_left in reversed(range(math.ceil(lock_timeout / _MODE_RETRY) + 1)):
        try:
            mode = _try_journal_mode(path, preferred)
            break
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or not attempts_left:
                raise
            time.sleep(_MODE_RETRY)
    if mode not in {preferred, "delete"}:
        raise StorageUnavailable(
            f"{path} is in journal mode {mode}, which this SQLite must not use, and cannot leave it"
        )
    return mode


def _try_journal_mode(path: Path, preferred: str) -> str:
    with closing(sqlite3.connect(path, timeout=0.0, isolation_level=None)) as connection:
        mode = str(connection.execute("PRAGMA journal_mode").fetchone()[0])
        if mode != preferred:
            mode = str(connection.execute(f"PRAGMA journal_mode={preferred}").fetchone()[0])
    return mode


def make_engine(path: Path, lock_timeout: float, *, foreign_keys: bool = True, pooled: bool = True) -> Engine:
    """An engine on the file, with the settings of every connection. Its user begins each transaction by a statement."""
    url = URL.create("sqlite+pysqlite", database=str(path))
    arguments = {"timeout": lock_timeout, "check_same_thread": False}
    if pooled:
        # No upper bound: a connection is cheap, and the threads that use one are bounded elsewhere.
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

    return engine
