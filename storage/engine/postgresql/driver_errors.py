"""The driver's errors as the store's own, by SQLSTATE.

Source: https://www.postgresql.org/docs/current/errcodes-appendix.html. The driver itself is not loaded here.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy.exc import DataError, DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from storage.engine.errors import DatabaseBusy, StorageError, StorageUnavailable, UnstorableText

#: A lock that was not free in time, a serialization failure, a deadlock, and too many connections.
LOCK_NOT_FREE = "55P03"
_BUSY = {
    LOCK_NOT_FREE: "another writer held the database for too long",
    "40001": "another transaction was in the way",
    "40P01": "another transaction was in the way",
    "53300": "the server has no free connection",
}
_READ_ONLY = "25006"
#: Classes of codes: connections, passwords, unknown databases, means of the server, its operator, its disk, its faults.
_UNAVAILABLE = ("08", "28", "3D", "53", "57", "58", "XX")


@contextmanager
def translated(name: str) -> Iterator[None]:
    """Raise the store's own errors, naming the database, for what driver and pool raise inside; all else passes."""
    try:
        yield
    except (PoolTimeoutError, DBAPIError) as error:
        own = _store_error(error, name)
        if own is None:
            raise
        raise own from error


def _store_error(error: Exception, name: str) -> StorageError | None:
    """The store's own error, or None where it is the program's (a constraint, bad SQL)."""
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
    # a connection that was refused or has broken has no code
    if error.connection_invalidated or code is None or code.startswith(_UNAVAILABLE):
        return StorageUnavailable(f"{name}: the server cannot be used ({reason})")
    return None
