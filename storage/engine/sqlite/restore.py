"""A backup put in the place of a database, at every moment with one of the two under the database's name."""

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from storage.engine.errors import DatabaseBusy, StorageUnavailable
from storage.engine.limits import LOCK_TIMEOUT
from storage.engine.sqlite.backup import copy_whole, names_beside, renamed
from storage.engine.sqlite.connect import path_of
from storage.engine.sqlite.driver_errors import DRIVER_ERRORS
from storage.engine.sqlite.integrity import require_whole
from storage.engine.sqlite.service_lock import service_lock
from storage.engine.sqlite.transactions import translated
from storage.engine.sqlite.write_lock import WriteLock

#: What SQLite keeps beside a file: commits that are not in it yet, and what readers share.
_LOG, _SHARED = "-wal", "-shm"


def restore(url: str, backup: Path, *, lock_timeout: float = LOCK_TIMEOUT) -> Path | None:
    """Put the database in the file `backup` in the place of the one at `url`, whatever the revisions of the two.

    Returns where the replaced file is kept, `FILE-replaced` beside it, None where there was none. Raises ServiceRuns while a
    service uses the database, DatabaseBusy while anything else does, StorageUnavailable where `backup` is no whole database;
    then nothing has changed.
    """
    path = path_of(url)
    if not backup.is_file():
        raise FileNotFoundError(f"there is no backup at {backup}")
    if path.exists() and path.samefile(backup):
        raise ValueError(f"{backup} is the database itself")
    partial = path.with_name(f"{path.name}-restored.partial")
    with service_lock(path), closing(WriteLock(path, lock_timeout)) as lock, lock.held():
        partial.unlink(missing_ok=True)
        try:
            with translated(backup):
                try:
                    require_whole(backup)
                    copy_whole(backup, partial, lock_timeout)
                except sqlite3.DatabaseError as error:
                    raise StorageUnavailable(f"{backup} cannot be restored: {error}") from error
            kept = _kept(path) if path.exists() else None
            renamed(partial, path)
        finally:
            partial.unlink(missing_ok=True)
    return kept


def _kept(path: Path) -> Path:
    """The file under a second name, with its log; nothing beside it that would be taken for the restored one's log."""
    _settle(path)
    kept = next(name for name in names_beside(path, "replaced") if not name.exists())
    log = path.with_name(path.name + _LOG)
    if log.exists():
        _second_name(log, kept.with_name(kept.name + _LOG))
    _second_name(path, kept)
    log.unlink(missing_ok=True)
    path.with_name(path.name + _SHARED).unlink(missing_ok=True)
    return kept


def _settle(path: Path) -> None:
    """Bring the log's commits into the file, so that the file is all there is; a damaged one is left with its log."""
    try:
        with closing(sqlite3.connect(path, timeout=0.0, isolation_level=None)) as connection:
            connection.execute("PRAGMA journal_mode=DELETE")
    except DRIVER_ERRORS as error:
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            raise DatabaseBusy(f"{path}: another process has the database open: end it first") from error
        if code not in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
            raise


def _second_name(path: Path, name: Path) -> None:
    try:
        os.link(path, name)
    except OSError:  # a volume without links: bytes instead
        shutil.copyfile(path, name)
