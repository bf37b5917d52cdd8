"""The driver's errors as the store's own.

The low byte of a result code is its class. Source: https://www.sqlite.org/rescode.html.
"""

import sqlite3
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


#: Everything that driver and pool raise.
DRIVER_ERRORS = (PoolTimeoutError, DBAPIError, sqlite3.Error)


def store_error(error: Exception, path: Path) -> StorageError | None:
    """The store's own error for one of DRIVER_ERRORS, or None where it is the program's (a constraint, bad SQL)."""
    if isinstance(error, PoolTimeoutError):
        return DatabaseBusy(f"{path}: no free connection ({error})")
    origin = error.orig if isinstance(error, DBAPIError) else error
    code = getattr(origin, "sqlite_errorcode", None)
    if code is None:
        return None
    primary = code & 0xFF
    if primary in _BUSY:
        return DatabaseBusy(f"{path}: {_BUSY[primary]} ({origin})")
    if primary in _UNAVAILABLE:
        return StorageUnavailable(f"{path}: {_UNAVAILABLE[primary]} ({origin})")
    return None
