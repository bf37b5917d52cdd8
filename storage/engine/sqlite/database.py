"""A database that is one file: how it comes to be, its migration, and its backup."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path

from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from storage.engine.errors import DatabaseTooOld, StorageUnavailable
from storage.engine.integrity import refuse_newer
from storage.engine.limits import LOCK_TIMEOUT
from storage.engine.sqlite.backup import copy, copy_beside
from storage.engine.sqlite.connect import (
    found_journal_mode,
    make_engine,
    path_of,
    set_journal_mode,
    wanted_journal_mode,
)
from storage.engine.sqlite.health import faults
from storage.engine.sqlite.integrity import damage
from storage.engine.sqlite.private_files import make_if_missing
from storage.engine.sqlite.service_lock import service_lock
from storage.engine.sqlite.transactions import Transactions, transaction, translated
from storage.engine.sqlite.write_lock import WriteLock
from storage.migrations.upgrade import current, head, upgrade


class FileDatabase(Transactions):
    """An open file. Made by `open_file`."""

    journal_mode: str

    def __init__(self, path: Path, *, journal_mode: str, lock_timeout: float, writable: bool = True) -> None:
        super().__init__(path, lock_timeout, writable=writable)
        self.url = f"sqlite:///{path.absolute()}"
        self.journal_mode = journal_mode

    def faults(self, *, least_free: int) -> dict[str, str]:
        """What keeps the file or its disk from being used."""
        if self._closed:
            return {"database": "it has been closed"}
        return faults(self.path, journal_mode=self.journal_mode, least_free=least_free)

    def damage(self, connection: Connection) -> list[str]:
        """What is wrong with the pages, the indexes and the references."""
        return damage(connection)


class FoundFile(FileDatabase):
    """A file that is only read, at the revision that it was found at. Made by `find_file`."""

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """As every database's; raises DatabaseTooOld where what is asked for came with a later revision."""
        with super().reading() as connection:
            try:
                yield connection
            except OperationalError as error:
                revision = current(connection)
                if revision == head():
                    raise
                raise DatabaseTooOld(
                    f"{self.path} is at revision {revision}, this needs {head()}: `clutchlife serve` brings it there, "
                    "and keeps a copy of the file beside it"
                ) from error


def find_file(path: Path, *, lock_timeout: float = LOCK_TIMEOUT) -> FoundFile:
    """Open a file to read it as it is, whatever its revision up to this code's; nothing is made or migrated.

    Raises DatabaseTooNew as `open_file` does, StorageUnavailable where there is no such file.
    """
    with translated(path):
        journal_mode = found_journal_mode(path, lock_timeout)
    database = FoundFile(path, journal_mode=journal_mode, lock_timeout=lock_timeout, writable=False)
    try:
        with database.reading() as connection:
            refuse_newer(current(connection))
    except BaseException:
        database.close()
        raise
    return database


def back_up(url: str, target: Path, *, lock_timeout: float = LOCK_TIMEOUT) -> None:
    """A consistent copy of the database at `target`, at the revision that it is at, while others read and write.

    Raises FileExistsError where `target` exists, StorageUnavailable as `find_file` does, ValueError on another address.
    """
    path = path_of(url)
    with translated(path):
        copy(path, target, lock_timeout=lock_timeout)


def open_file(path: Path, *, lock_timeout: float = LOCK_TIMEOUT, serving: bool = False) -> FileDatabase:
    """Open the file at `path`, make it where it is not there, and run the migrations that it lacks.

    A file is copied before it is migrated, to `FILE-before-REVISION` beside it, and is not migrated under a running service;
    `serving`: it is the service itself that opens it, and holds `service_lock`.

    Raises DatabaseTooNew on the file of a newer release, StorageUnavailable where the file cannot be used, DatabaseBusy
    where others hold it for `lock_timeout` [s], ServiceRuns where it is to be migrated and a service uses it.

    A file that has its log and lacks no migration is only read, without the write lock: a process that yields to all
    others would hold it for as long as they are busy.
    """
    with translated(path):
        journal_mode = _mode_if_up_to_date(path, lock_timeout)
        if journal_mode is None:
            with closing(WriteLock(path, lock_timeout)) as lock, lock.held():
                make_if_missing(path)
                journal_mode = set_journal_mode(path, lock_timeout)
                _migrate(path, lock_timeout, serving=serving)
    return FileDatabase(path, journal_mode=journal_mode, lock_timeout=lock_timeout)


def _mode_if_up_to_date(path: Path, lock_timeout: float) -> str | None:
    """The journal mode of a file that needs no change; None where it needs one, is not there, or cannot be read."""
    if not path.is_file():
        return None
    try:
        journal_mode = wanted_journal_mode(path, lock_timeout)
        if journal_mode is None:
            return None
        with transaction(make_engine(path, lock_timeout, pooled=False), "BEGIN") as connection:
            return journal_mode if current(connection) == head() else None
    except (sqlite3.OperationalError, OperationalError):  # under the lock it is found out why
        return None


def _migrate(path: Path, lock_timeout: float, *, serving: bool) -> None:
    """Run the missing steps in one immediate transaction; the caller holds the write lock, so that one process does."""
    # A step may rebuild a table that others refer to, so keys are checked once at the end.
    engine = make_engine(path, lock_timeout, foreign_keys=False, pooled=False)
    with transaction(engine, "BEGIN") as connection:
        revision = current(connection)
    if revision == head():
        return
    refuse_newer(revision)
    in_use = revision is not None
    with service_lock(path) if in_use and not serving else nullcontext():
        if in_use:
            copy_beside(path, f"before-{head()}", lock_timeout=lock_timeout)
        with transaction(engine, "BEGIN IMMEDIATE") as connection:
            upgrade(connection)
            broken = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
            if broken:
                raise StorageUnavailable(f"{path} holds rows that refer to missing rows: {broken[:5]}")
