"""What every request asks of a file, without a transaction. A row that was read is kept until something is committed."""

import threading
from pathlib import Path
from typing import Any

from storage.engine.errors import StorageUnavailable
from storage.engine.sqlite.connect import connect_shared
from storage.engine.sqlite.driver_errors import DRIVER_ERRORS, store_error
from storage.engine.watch import GrantedKey, Watch, granted

#: Rows that are kept at most. Chosen: some clutches and keys; all are forgotten when there are more.
_MOST_ROWS = 10_000
_KEY = "SELECT key_id, scope, note, clutches, expires_at FROM access_key WHERE secret_sha256 = ? AND revoked_at IS NULL"


class FileWatch(Watch):
    """A connection of its own, shared by threads. With a write-ahead log it waits for nobody."""

    def __init__(self, path: Path, lock_timeout: float, *, writable: bool = True) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._rows: dict[tuple[str, tuple[object, ...]], tuple[Any, ...] | None] = {}
        self._rows_version = -1
        self._closed = False
        self._connection = connect_shared(path, lock_timeout, writable=writable)

    def version(self) -> int:
        """PRAGMA data_version."""
        with self._lock:
            return self._version()

    def revision(self, clutch_id: str) -> int | None:
        """The clutch's revision, or None."""
        row = self._row("SELECT revision FROM clutch WHERE clutch_id = ?", clutch_id)
        return None if row is None else int(row[0])

    def key(self, secret_sha256: str) -> GrantedKey | None:
        """What the key with this hash grants; None where there is none or it was revoked. Whether it has expired the caller
        looks at."""
        row = self._row(_KEY, secret_sha256)
        return None if row is None else granted(row)

    def keys_are_needed(self) -> bool:
        """Whether a key was ever made: revoking the last one opens nothing."""
        row = self._row("SELECT EXISTS (SELECT 1 FROM access_key)")
        return row is not None and bool(row[0])

    def _row(self, query: str, *values: object) -> tuple[Any, ...] | None:
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
        """Close the connection; any later question raises StorageUnavailable."""
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
