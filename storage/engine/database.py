"""The open database: what the rest of the program holds, and how it comes to be."""

import sqlite3
from contextlib import closing
from pathlib import Path

from sqlalchemy.exc import OperationalError

from storage.engine.backup import copy
from storage.engine.connect import make_engine, path_of, set_journal_mode, wanted_journal_mode
from storage.engine.errors import DatabaseTooNew, StorageUnavailable
from storage.engine.health import is_ready
from storage.engine.limits import LOCK_TIMEOUT
from storage.engine.transactions import Transactions, transaction, translated
from storage.engine.write_lock import WriteLock
from storage.migrations.upgrade import current, head, revisions, upgrade


class Database(Transactions):
    """An open database: its transactions, its health and its backups. Made by `open_database`."""

    def __init__(self, path: Path, *, journal_mode: str, lock_timeout: float) -> None:
        super().__init__(path, lock_timeout)
        self.journal_mode = journal_mode

    def ready(self) -> bool:
        """Whether the file is there, answers at the code's revision, and could be written. Leaves nothing written."""
        return is_ready(self)

    def backup(self, path: Path) -> None:
        """A consistent copy at `path` while others read and write. Raises FileExistsError where `path` exists."""
        self.refuse_closed()
        with translated(self.path):
            copy(self.path, path, lock_timeout=self.lock_timeout)


def open_database(url: str, *, lock_timeout: float = LOCK_TIMEOUT) -> Database:
    """Open `sqlite:///path` (`sqlite:////path` where it is absolute), make the file and run the migrations it lacks.

    Raises ValueError on another scheme or a database in memory, DatabaseTooNew on the file of a newer release,
    StorageUnavailable where the file cannot be used, DatabaseBusy where others hold it for `lock_timeout` [s].

    A file that has its log and lacks no migration is only read, without the write lock: a process that yields to all
    others would hold it for as long as they are busy.
    """
    path = path_of(url)
    with translated(path):
        journal_mode = _mode_if_up_to_date(path, lock_timeout)
        if journal_mode is None:
            with closing(WriteLock(path, lock_timeout)) as lock, lock.held():
                journal_mode = set_journal_mode(path, lock_timeout)
                _migrate(path, lock_timeout)
    return Database(path, journal_mode=journal_mode, lock_timeout=lock_timeout)


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


def _migrate(path: Path, lock_timeout: float) -> None:
    """Run the missing steps in one immediate transaction: of two processes that start at once, one waits."""
    # A step may rebuild a table that others refer to, so keys are checked once at the end.
    engine = make_engine(path, lock_timeout, foreign_keys=False, pooled=False)
    with transaction(engine, "BEGIN") as connection:
        if current(connection) == head():
            return
    with transaction(engine, "BEGIN IMMEDIATE") as connection:
        revision = current(connection)
        if revision is not None and revision not in revisions():
            raise DatabaseTooNew(
                f"the database is at revision {revision}, this release knows up to {head()}: use a newer one"
            )
        upgrade(connection)
        broken = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchall()
        if broken:
            raise StorageUnavailable(f"{path} holds rows that refer to missing rows: {broken[:5]}")
