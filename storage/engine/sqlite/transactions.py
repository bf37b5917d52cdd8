"""Transactions of one file: many readers, one writer at a time.

Readers begin by BEGIN, writers by BEGIN IMMEDIATE, so that a writer either has the lock before its first statement or has
changed nothing. Writers of all threads and processes queue for a lock of our own (`write_lock`).
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine

from storage.engine.database import Database
from storage.engine.errors import StorageUnavailable
from storage.engine.sqlite.connect import make_engine
from storage.engine.sqlite.driver_errors import DRIVER_ERRORS, store_error
from storage.engine.sqlite.watch import FileWatch
from storage.engine.sqlite.write_lock import WriteLock


@contextmanager
def translated(path: Path) -> Iterator[None]:
    """Raise the store's own errors, naming the file, for what driver and pool raise inside; all else passes."""
    try:
        yield
    except DRIVER_ERRORS as error:
        own = store_error(error, path)
        if own is None:
            raise
        raise own from error


@contextmanager
def transaction(engine: Engine, begin: str) -> Iterator[Connection]:
    """A connection inside a transaction that the statement `begin` has begun: committed at the end, or rolled back."""
    with engine.begin() as connection:
        connection.exec_driver_sql(begin)
        yield connection


class Transactions(Database):
    """The transactions of a database file. Threads share it; `close` it at the end."""

    path: Path
    watch: FileWatch

    def __init__(self, path: Path, lock_timeout: float, *, writable: bool = True) -> None:
        self.path = path
        self.lock_timeout = lock_timeout
        self._write_lock = WriteLock(path, lock_timeout)
        self._closed = False
        self._engine = make_engine(path, lock_timeout, writable=writable)
        with translated(path):
            self.watch = FileWatch(path, lock_timeout, writable=writable)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection that sees one state of the database until the block ends. Keep it short: the log grows meanwhile."""
        self.refuse_closed()
        with translated(self.path), transaction(self._engine, "BEGIN") as connection:
            yield connection

    @contextmanager
    def writing(self, *, of: str | None = None) -> Iterator[Connection]:  # noqa: ARG002  (a file has one writer)
        """A connection that holds the write lock: committed when the block ends, rolled back on any exception.

        Raises DatabaseBusy where the lock is not free in time, StorageUnavailable where the file cannot be written.
        """
        self.refuse_closed()
        with (
            self._write_lock.held(),
            translated(self.path),
            transaction(self._engine, "BEGIN IMMEDIATE") as connection,
        ):
            yield connection

    def close(self) -> None:
        """Close all connections; any later use raises StorageUnavailable. May be called twice."""
        self._closed = True
        self.watch.close()
        self._engine.dispose()
        self._write_lock.close()

    def refuse_closed(self) -> None:
        """Raise StorageUnavailable after `close`."""
        if self._closed:
            raise StorageUnavailable(f"the database {self.path} has been closed")
