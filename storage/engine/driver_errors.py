"""The driver's errors as the store's own.

The low byte of a result code is its class. Source: https://www.sqlite.org/rescode.html.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from storage.engine.errors import DatabaseBusy, StorageError, StorageUnavailable

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


def translate(error: sqlite3.Error, path: Path) -> StorageError | None:
    """The store's own error for a driver's, or None where it is a mistake of the program (a constraint, bad SQL)."""
    code = getattr(error, "sqlite_errorcode", None)
    if code is None:
        return None
    primary = code & 0xFF
    if primary in _BUSY:
        return DatabaseBusy(f"{path}: {_BUSY[primary]} ({error})")
    if primary in _UNAVAILABLE:
        return StorageUnavailable(f"{path}: {_UNAVAILABLE[primary]} ({error})")
    return None


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """Raise the store's own errors, naming the file, for what driver and pool raise inside; all else passes."""
    try:
        yield
    except PoolTimeoutError as error:
        raise DatabaseBusy(f"{path}: no free connection ({error})") from error
    except (DBAPIError, sqlite3.Error) as error:
        origin = error.orig if isinstance(error, DBAPIError) else error
        own = translate(origin, path) if isinstance(origin, sqlite3.Error) else None
        if own is None:
            raise
        raise own from error
