"""What polls ask, without a transaction: whether anything was committed, and rows of small queries, kept until it was."""

import sqlite3
import threading
from pathlib import Path
from typing import Any

from storage.engine.driver_errors import DRIVER_ERRORS, store_error
from storage.engine.errors import StorageUnavailable

#: Rows that are kept at most. Chosen: some clutches and keys; all are forgotten when there are more.
_MOST_ROWS = 10_000


class Watch:
    """A connection of its own, shared by threads. With a write-ahead log it waits for nobody."""

    def __init__(self, path: Path, lock_timeout: float) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._rows: dict[tuple[str, tuple[object, ...]], tuple[Any, ...] | None] = {}
        self._rows_version = -1
        self._closed = False
        self._connection = sqlite3.connect(path, timeout=lock_timeout, isolation_level=None, check_same_thread=False)

    def version(self) -> int:
        """A number that changes with every commit, whichever process made it. Compare it only within this object.

        Read before a query, it shows later whether the query would still give the same rows.
        """
        with self._lock:
            return self._version()

    def row(self, query: str, *values: object) -> tuple[Any, ...] | None:
        """The first row of a query by key as it is now, None where there is none; asked of the file once a commit."""
        key = (query, values)
        with self._lock:
            version = self._version()
            if version != self._rows_version or len(self._rows) > _MOST_ROWS:
                self._rows.clear()
                self._rows_version = version
            if key not in self._rows:
                self._rows[key] = self._first(query, values)
            return self._rows[key]

    def close(self) -> None:
        """Close the connection; any later use raises StorageUnavailable. May be called twice."""
        with self._lock:
            self._closed = True
            self._connection.close()

    def _version(self) -> int:
        row = self._first("PRAGMA data_version", ())
        return 0 if row is None else int(row[0])

    def _first(self, query: str, values: tuple[object, ...]) -> tuple[Any, ...] | None:
        if self._closed:
            raise StorageUnavailable(f"the database {self._path} has been closed")
        try:
            # fetched to the end: an open statement would keep the log from being written back
            rows = self._connection.execute(query, values).fetchall()
        except DRIVER_ERRORS as error:
            own = store_error(error, self._path)
            if own is None:
                raise
            raise own from error
        return rows[0] if rows else None
