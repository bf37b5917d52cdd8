"""One writer of a database at a time, among the threads of this process and among processes: a lock beside the file.

SQLite before 3.51.3 may lose commits of a write-ahead log where one connection checkpoints while another commits
(https://www.sqlite.org/wal.html, "the WAL-reset bug"). Here every write transaction, with the checkpoint that its commit may
run, is made under this lock, so that no two ever meet, whichever release of SQLite the system has. Readers do not take it.
"""

import fcntl
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from storage.engine.errors import DatabaseBusy, StorageUnavailable
from storage.engine.sqlite.private_files import MODE

#: [s] Between two attempts to take the lock from another process: first and longest. Chosen: a commit takes 1 to 5 ms.
_FIRST_RETRY, _LONGEST_RETRY = 0.0005, 0.005


class WriteLock:
    """The lock of one database file, `FILE-lock`; every process that writes the file takes it. `close` it at the end."""

    def __init__(self, path: Path, timeout: float) -> None:
        self._path = path.with_name(f"{path.name}-lock")
        self._timeout = timeout
        self._thread_lock = threading.Lock()
        self._file: int | None = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the lock inside.

        Raises DatabaseBusy where it is not free in time, StorageUnavailable where its file cannot be made.
        """
        deadline = time.monotonic() + self._timeout
        if not self._thread_lock.acquire(timeout=self._timeout):
            raise DatabaseBusy(f"another writer of this process held the database for more than {self._timeout:g} s")
        try:
            file = self._opened()
            self._take(file, deadline)
            try:
                yield
            finally:
                fcntl.flock(file, fcntl.LOCK_UN)
        finally:
            self._thread_lock.release()

    def close(self) -> None:
        """Close the file. The lock may be held again afterwards."""
        with self._thread_lock:
            if self._file is not None:
                os.close(self._file)
                self._file = None

    def _opened(self) -> int:
        if self._file is None:
            try:
                self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, MODE)
            except OSError as error:
                raise StorageUnavailable(
                    f"{self._path}: the lock of the database cannot be opened ({error})"
                ) from error
        return self._file

    def _take(self, file: int, deadline: float) -> None:
        pause = _FIRST_RETRY
        while True:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise DatabaseBusy(
                        f"{self._path}: another process held the database for more than {self._timeout:g} s"
                    ) from None
                time.sleep(pause)
                pause = min(2 * pause, _LONGEST_RETRY)
            else:
                return
