"""Transactions of one file: many readers, one writer at a time.

Readers begin by BEGIN, writers by BEGIN IMMEDIATE, so that a writer either has the lock before its first statement or has
changed nothing. Among the threads of this process writers queue for a lock of our own; SQLite's lock holds off the others.
"""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine

from storage.engine.connect import make_engine
from storage.engine.driver_errors import DRIVER_ERRORS, store_error
from storage.engine.errors import DatabaseBusy, StorageUnavailable


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


class Transactions:
    """The transactions of a database file. Threads share it; `close` it at the end."""

    def __init__(self, path: Path, lock_timeout: float) -> None:
        self.path = path
        self.lock_timeout = lock_timeout
        self._writer_lock = threading.Lock()
        self._turns: dict[str, threading.Lock] = {}
        self._turns_lock = threading.Lock()
        self._closed = False
        self._engine = make_engine(path, lock_timeout)
        self._version_lock = threading.Lock()
        with translated(path):
            self._version_connection = sqlite3.connect(
                path, timeout=lock_timeout, isolation_level=None, check_same_thread=False
            )

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection that sees one state of the database until the block ends. Keep it short: commits wait for it."""
        self.refuse_closed()
        with translated(self.path), transaction(self._engine, "BEGIN") as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A connection that holds the write lock: committed when the block ends, rolled back on any exception.

        Raises DatabaseBusy where the lock is not free in time, StorageUnavailable where the file cannot be written.
        """
        self.refuse_closed()
        if not self._writer_lock.acquire(timeout=self.lock_timeout):
            raise DatabaseBusy(
                f"another writer of this process held the database for more than {self.lock_timeout:g} s"
            )
        try:
            with translated(self.path), transaction(self._engine, "BEGIN IMMEDIATE") as connection:
                yield connection
        finally:
            self._writer_lock.release()

    @contextmanager
    def turn(self, name: str, *, patient: bool = False) -> Iterator[None]:
        """One thread of this process at a time for a name: who would compute the same results at once waits instead.

        No lock of the database is held meanwhile. Raises DatabaseBusy where the turn does not come in time, lest all
        threads that serve requests wait; work in the background is `patient` and waits as long as it takes.
        """
        with self._turns_lock:
            turn = self._turns.setdefault(name, threading.Lock())
        if not turn.acquire(timeout=threading.TIMEOUT_MAX if patient else self.lock_timeout):
            raise DatabaseBusy(f"{name!r} was computed for more than {self.lock_timeout:g} s")
        try:
            yield
        finally:
            turn.release()

    def version(self) -> int:
        """A number that changes with every commit, whichever process made it. Compare it only within this object.

        Read before a query, it shows later whether the query would still give the same rows.
        """
        self.refuse_closed()
        with translated(self.path), self._version_lock:
            # fetched to the end: an open statement would hold up commits
            ((number,),) = self._version_connection.execute("PRAGMA data_version").fetchall()
        return int(number)

    def close(self) -> None:
        """Close all connections; any later use raises StorageUnavailable. May be called twice."""
        self._closed = True
        with self._version_lock:
            self._version_connection.close()
        self._engine.dispose()

    def refuse_closed(self) -> None:
        """Raise StorageUnavailable after `close`."""
        if self._closed:
            raise StorageUnavailable(f"the database {self.path} has been closed")
