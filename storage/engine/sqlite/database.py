"""The database in one SQLite file: transactions, migration and health.

Readers begin by BEGIN, writers by BEGIN IMMEDIATE, so that a writer either has the lock before its first statement or has
changed nothing. Writers of all threads and processes queue for the lock of `connect.WriteLock`.
"""

import os
import shutil
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from storage.engine.database import LOCK_TIMEOUT, Database, Question, Snapshot, Watch, granted, tracer
from storage.engine.errors import StorageUnavailable
from storage.engine.integrity import refuse_newer
from storage.engine.sqlite import connect
from storage.engine.sqlite.backup import copy, copy_beside, damage
from storage.migrations.upgrade import current, head, upgrade


def _fault_of_file(path: Path, journal_mode: str) -> str | None:
    """The fault of the file, if any: it is missing, does not answer, is at another revision, or cannot be written.

    A present writer delays nothing: a reader of the write-ahead log waits for no writer, and without that log a commit
    in progress shows that the file is in use.
    """
    if not path.exists():
        return "the file is not there"
    try:
        with closing(sqlite3.connect(connect.read_only(path), uri=True, timeout=0.0)) as connection:
            (revision,) = connection.execute("SELECT version_num FROM alembic_version").fetchone()
    except sqlite3.Error as error:
        busy = getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY
        if journal_mode == "wal" or not busy:
            return f"the file cannot be read: {error}"
    else:
        if revision != head():
            return f"the file is at revision {revision}, this release needs {head()}"
    if not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)):
        return "the file or its folder cannot be written"
    return None


#: Rows that are kept at most. Chosen: some clutches and keys; all are forgotten when there are more.
_MAX_ROWS = 10_000
_REVISION = "SELECT revision FROM clutch WHERE clutch_id = ?"
_ANY_KEY = "SELECT EXISTS (SELECT 1 FROM access_key)"
_KEY = "SELECT key_id, scope, note, clutches, expires_at FROM access_key WHERE secret_sha256 = ? AND revoked_at IS NULL"


class FileWatch(Watch):
    """The watch of a database file: a connection of its own, shared by threads. With a write-ahead log it waits for no
    lock."""

    def __init__(self, path: Path, lock_timeout: float, *, writable: bool = True) -> None:
        super().__init__(f"the database {path}", lock_timeout)
        self._path = path
        self._lock = threading.Lock()
        self._rows: dict[tuple[str, tuple[object, ...]], tuple[Any, ...] | None] = {}
        self._rows_version = -1
        self._connection = connect.connect_shared(path, lock_timeout, writable=writable)

    def snapshots(self, questions: Sequence[Question]) -> list[Snapshot]:
        with self._lock:
            version = self._version()
            if version != self._rows_version or len(self._rows) > _MAX_ROWS:
                self._rows.clear()
                self._rows_version = version
            return [self._snapshot(version, question) for question in questions]

    def _snapshot(self, version: int, question: Question) -> Snapshot:
        """The state for a whole request, at one `version` of the file: whether keys are needed, the key's permissions,
        and the clutch's revision."""
        any_key = self._row(_ANY_KEY)
        key = None if question.secret_sha256 is None else self._row(_KEY, question.secret_sha256)
        revision = None if question.clutch_id is None else self._row(_REVISION, question.clutch_id)
        return Snapshot(
            version=version,
            keys_are_needed=any_key is not None and bool(any_key[0]),
            key=None if key is None else granted(key),
            revision=None if revision is None else int(revision[0]),
        )

    def _row(self, query: str, *values: object) -> tuple[Any, ...] | None:
        """The present first row of a query, None if there is none; read from the file once per commit."""
        key = (query, values)
        if key not in self._rows:
            self._rows[key] = self._first(query, values)
        return self._rows[key]

    def close(self) -> None:
        super().close()
        with self._lock:
            self._connection.close()

    def _version(self) -> int:
        row = self._first("PRAGMA data_version", ())
        return 0 if row is None else int(row[0])

    def _first(self, query: str, values: tuple[object, ...]) -> tuple[Any, ...] | None:
        self.refuse_closed()
        with connect.translated(self._path):
            # fetched to the end: an open statement would keep the log from being written back
            rows = self._connection.execute(query, values).fetchall()
        return rows[0] if rows else None


class FileDatabase(Database):
    """An open database file. Made by `open_file`."""

    path: Path
    journal_mode: str
    watch: FileWatch

    def __init__(self, path: Path, *, journal_mode: str, lock_timeout: float, found: bool = False) -> None:
        super().__init__(str(path), found=found)
        self.path, self.url = path, f"sqlite:///{path.absolute()}"
        self.journal_mode = journal_mode
        self._write_lock = connect.WriteLock(path, lock_timeout)
        self._engine = connect.make_engine(path, lock_timeout, writable=not found)
        with connect.translated(path):
            self.watch = FileWatch(path, lock_timeout, writable=not found)

    @contextmanager
    def _read(self) -> Iterator[Connection]:
        with connect.translated(self.path), connect.transaction(self._engine, "BEGIN") as connection:
            yield connection

    @contextmanager
    def writing(self, *, of: str | None = None) -> Iterator[Connection]:  # noqa: ARG002  (a file has one writer)
        self._refuse_closed()
        with (
            tracer.start_as_current_span("store"),
            self._write_lock.held(),
            connect.translated(self.path),
            connect.transaction(self._engine, "BEGIN IMMEDIATE") as connection,
        ):
            yield connection

    def close(self) -> None:
        self._closed = True
        self.watch.close()
        self._engine.dispose()
        self._write_lock.close()

    def faults(self, *, least_free: int) -> dict[str, str]:
        if self._closed:
            return {"database": "it has been closed"}
        wrong = {}
        try:
            fault = _fault_of_file(self.path, self.journal_mode)
        except OSError as error:
            fault = f"the file cannot be read: {error.strerror}"
        if fault is not None:
            wrong["database"] = fault
        try:
            free = shutil.disk_usage(self.path.parent).free
        except OSError as error:
            wrong["disk"] = f"the disk does not answer: {error.strerror}"
        else:
            if free < least_free:
                wrong["disk"] = f"{free >> 20} MiB are free on the database's disk, {least_free >> 20} are needed"
        return wrong

    def damage(self, connection: Connection) -> list[str]:
        return damage(connection)


def find_file(path: Path) -> FileDatabase:
    """Open a file for reading, at its present revision, which may be older than this code's; nothing is created or
    migrated.

    Raises DatabaseTooNew as `open_file` does, StorageUnavailable where there is no such file.
    """
    with connect.translated(path):
        journal_mode = connect.found_journal_mode(path, LOCK_TIMEOUT)
    database = FileDatabase(path, journal_mode=journal_mode, lock_timeout=LOCK_TIMEOUT, found=True)
    return database.where(lambda connection: refuse_newer(current(connection)))


def back_up(url: str, target: Path) -> None:
    """A consistent copy of the database at `target`, at the database's revision, while others read and write.

    Raises FileExistsError where `target` exists, StorageUnavailable as `find_file` does, ValueError on another address.
    """
    path = connect.path_of(url)
    with connect.translated(path):
        copy(path, target, lock_timeout=LOCK_TIMEOUT)


def open_file(path: Path, *, lock_timeout: float = LOCK_TIMEOUT, serving: bool = False) -> FileDatabase:
    """Open the file at `path`, create it if needed, and run missing migrations.

    A file is copied before it is migrated, to `FILE-before-REVISION` beside it, and is not migrated under a running service;
    `serving`: it is the service itself that opens it, and holds `service_lock`.

    Raises DatabaseTooNew on the file of a newer release, StorageUnavailable where the file cannot be used, DatabaseBusy
    where others hold it for `lock_timeout` [s], ServiceRuns where it is to be migrated and a service uses it.

    A file that has its log and lacks no migration is only read, without the write lock: a process that yields to all
    others would hold it for as long as they are busy.
    """
    with connect.translated(path):
        journal_mode = _mode_if_up_to_date(path, lock_timeout)
        if journal_mode is None:
            with closing(connect.WriteLock(path, lock_timeout)) as lock, lock.held():
                connect.make_if_missing(path)
                journal_mode = connect.set_journal_mode(path, lock_timeout)
                _migrate(path, lock_timeout, serving=serving)
    return FileDatabase(path, journal_mode=journal_mode, lock_timeout=lock_timeout)


def _mode_if_up_to_date(path: Path, lock_timeout: float) -> str | None:
    """The journal mode of a file that needs no change; None if it needs one, is missing, or cannot be read."""
    if not path.is_file():
        return None
    try:
        journal_mode = connect.wanted_journal_mode(path, lock_timeout)
        if journal_mode is None:
            return None
        with connect.transaction(connect.make_engine(path, lock_timeout, pooled=False), "BEGIN") as connection:
            return journal_mode if current(connection) == head() else None
    except (sqlite3.OperationalError, OperationalError):  # under the lock it is found out why
        return None


def _migrate(path: Path, lock_timeout: float, *, serving: bool) -> None:
    """Run the missing migrations in one immediate transaction; the caller holds the write lock, so that only one
    process does."""
    # A step may rebuild a table that others refer to, so keys are checked once at the end.
    engine = connect.make_engine(path, lock_timeout, foreign_keys=False, pooled=False)
    with connect.transaction(engine, "BEGIN") as connection:
        revision = current(connection)
    if revision == head():
        return
    refuse_newer(revision)
    in_use = revision is not None
    with connect.service_lock(path) if in_use and not serving else nullcontext():
        if in_use:
            copy_beside(path, f"before-{head()}", lock_timeout=lock_timeout)
        with connect.transaction(engine, "BEGIN IMMEDIATE") as connection:
            upgrade(connection)
            broken = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
            if broken:
                raise StorageUnavailable(f"{path} holds rows that refer to missing rows: {broken[:5]}")
