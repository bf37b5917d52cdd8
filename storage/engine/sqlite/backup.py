"""Whole copies of a file: made of a database in use, put in its place, and checked.

A copy is SQLite's online backup (https://www.sqlite.org/backup.html): the source is only read, at whatever revision it is.
A restored one takes the database's name so that at every moment one of the two has it.
Source of the checks: https://www.sqlite.org/pragma.html#pragma_integrity_check.
"""

import filecmp
import itertools
import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from sqlalchemy import Connection

from storage.engine.database import LOCK_TIMEOUT
from storage.engine.errors import DatabaseBusy, StorageUnavailable
from storage.engine.sqlite import connect

#: Findings of one kind that are listed. Chosen: a screenful; SQLite's own default is 100.
_MAX_LISTED = 20


def damage(connection: Connection) -> list[str]:
    """Damage to the pages, indexes and references of a database, each a sentence; empty if there is none."""
    pages = [str(row[0]) for row in connection.exec_driver_sql(f"PRAGMA integrity_check({_MAX_LISTED})")]
    broken = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchmany(_MAX_LISTED)
    return [f"integrity: {line}" for line in pages if line != "ok"] + [
        f"row {row} of {table} refers to a row of {other} that is missing" for table, row, other, _ in broken
    ]


def require_whole(path: Path) -> None:
    """Raise sqlite3.DatabaseError unless the file at `path` is an undamaged database of this program, at any revision."""
    with closing(sqlite3.connect(connect.read_only(path), uri=True)) as connection:
        (line,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
        if line != "ok":
            raise sqlite3.DatabaseError(f"it is damaged: {line}")
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'alembic_version'").fetchone():
            raise sqlite3.DatabaseError("it is not a database of this program")


def copy(source: Path, target: Path, *, lock_timeout: float) -> None:
    """Copy the database at `source` to the new file `target`, in one consistent state, while others read and write.

    All pages are copied in one step: with a rollback journal, commits wait for it; stepwise copying starts again at
    every commit and need not end. `target` is an empty file until the copy is whole.
    Raises FileExistsError where `target` exists.
    """
    try:
        connect.make_new(target)
    except FileExistsError as error:
        raise FileExistsError(f"{target} exists already: name a new file for the backup") from error
    partial = target.with_name(f"{target.name}.partial")
    try:
        connect.make_if_missing(partial)
        copy_whole(source, partial, lock_timeout)
        renamed(partial, target)
    except BaseException:
        partial.unlink(missing_ok=True)
        target.unlink()
        raise


def copy_beside(source: Path, suffix: str, *, lock_timeout: float) -> Path:
    """Copy the database at `source` to `FILE-suffix`, or to the first of `FILE-suffix.2` and so on without other
    content.

    Returns the copy's path; it is there whole or not at all. The caller holds the write lock.
    """
    partial = source.with_name(f"{source.name}-{suffix}.partial")
    partial.unlink(missing_ok=True)
    try:
        copy_whole(source, partial, lock_timeout)
        for target in names_beside(source, suffix):
            if not target.exists():
                return renamed(partial, target)
            if filecmp.cmp(target, partial, shallow=False):
                return target
    finally:
        partial.unlink(missing_ok=True)
    raise AssertionError("names do not end")


def names_beside(path: Path, suffix: str) -> Iterator[Path]:
    """The endless sequence `FILE-suffix`, `FILE-suffix.2`, `FILE-suffix.3`, …"""
    yield path.with_name(f"{path.name}-{suffix}")
    yield from (path.with_name(f"{path.name}-{suffix}.{number}") for number in itertools.count(2))


def renamed(path: Path, target: Path) -> Path:
    """Rename a file durably, replacing any file of the new name; after a power cut one of the two is there. Returns the
    new path."""
    path.replace(target)
    folder = os.open(target.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return target


def copy_whole(source: Path, target: Path, lock_timeout: float) -> None:
    """Copy the database at `source` into the new file `target`, complete only at the end."""
    with (
        closing(sqlite3.connect(connect.read_only(source), uri=True, timeout=lock_timeout)) as origin,
        closing(sqlite3.connect(target)) as copied,
    ):
        origin.backup(copied)
        # One file without a log beside it, which any SQLite may open.
        copied.execute("PRAGMA journal_mode=DELETE")


#: What SQLite keeps beside a file: commits that are not in it yet, and what readers share.
_LOG, _SHARED = "-wal", "-shm"


def restore(url: str, backup: Path, *, lock_timeout: float = LOCK_TIMEOUT) -> Path | None:
    """Replace the database at `url` by the file `backup`, at any revisions of the two.

    Returns where the replaced file is kept, `FILE-replaced` beside it, None where there was none. Raises ServiceRuns while a
    service uses the database, DatabaseBusy while anything else does, StorageUnavailable where `backup` is no whole database;
    then nothing has changed.
    """
    path = connect.path_of(url)
    if not backup.is_file():
        raise FileNotFoundError(f"there is no backup at {backup}")
    if path.exists() and path.samefile(backup):
        raise ValueError(f"{backup} is the database itself")
    partial = path.with_name(f"{path.name}-restored.partial")
    with connect.service_lock(path), closing(connect.WriteLock(path, lock_timeout)) as lock, lock.held():
        partial.unlink(missing_ok=True)
        try:
            with connect.translated(backup):
                try:
                    require_whole(backup)
                    copy_whole(backup, partial, lock_timeout)
                except sqlite3.DatabaseError as error:
                    raise StorageUnavailable(f"{backup} cannot be restored: {error}") from error
            replaced_file = _keep_replaced_file(path) if path.exists() else None
            renamed(partial, path)
        finally:
            partial.unlink(missing_ok=True)
    return replaced_file


def _keep_replaced_file(path: Path) -> Path:
    """Keep the replaced file with its log under a second name; no log remains that the restored file would read as its
    own."""
    _settle(path)
    kept_file = next(name for name in names_beside(path, "replaced") if not name.exists())
    log = path.with_name(path.name + _LOG)
    if log.exists():
        _second_name(log, kept_file.with_name(kept_file.name + _LOG))
    _second_name(path, kept_file)
    log.unlink(missing_ok=True)
    path.with_name(path.name + _SHARED).unlink(missing_ok=True)
    return kept_file


def _settle(path: Path) -> None:
    """Write the log's commits into the file, so that the file alone is complete; a damaged file is left with its log."""
    try:
        with closing(sqlite3.connect(path, timeout=0.0, isolation_level=None)) as connection:
            connection.execute("PRAGMA journal_mode=DELETE")
    except connect.DRIVER_ERRORS as error:
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
