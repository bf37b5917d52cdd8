"""What every request asks of a file, without a transaction. A row that was read is kept until something is committed."""

import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from storage.engine.errors import StorageUnavailable
from storage.engine.sqlite.connect import connect_shared
from storage.engine.sqlite.driver_errors import DRIVER_ERRORS, store_error
from storage.engine.watch import Glance, Question, Watch, granted

#: Rows that are kept at most. Chosen: some clutches and keys; all are forgotten when there are more.
_MOST_ROWS = 10_000
_REVISION = "SELECT revision FROM clutch WHERE clutch_id = ?"
_ANY_KEY = "SELECT EXISTS (SELECT 1 FROM access_key)"
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

    def glances(self, questions: Sequence[Question]) -> list[Glance]:
        """What is so now, question by question, all at the same moment."""
        with self._lock:
            version = self._version()
            if version != self._rows_version or len(self._rows) > _MOST_ROWS:
                self._rows.clear()
                self._rows_version = version
            return [self._glance(version, question) for question in questions]

    async def look(self, question: Question) -> Glance:
        """What is so now, for one who asks from the event loop: the file answers at once."""
        return self.glances([question])[0]

    def _glance(self, version: int, question: Question) -> Glance:
        any_key = self._row(_ANY_KEY)
        key = None if question.secret_sha256 is None else self._row(_KEY, question.secret_sha256)
        revision = None if question.clutch_id is None else self._row(_REVISION, question.clutch_id)
        return Glance(
            version=version,
            keys_are_needed=any_key is not None and bool(any_key[0]),
            key=None if key is None else granted(key),
            revision=None if revision is None else int(revision[0]),
        )

    def _row(self, query: str, *values: object) -> tuple[Any, ...] | None:
        """The first row of a query by key as it is now, None where there is none; asked of the file once a commit."""
        key = (query, values)
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
