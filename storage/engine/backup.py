"""A consistent copy of a database in use, by SQLite's online backup (https://www.sqlite.org/backup.html)."""

import sqlite3
from contextlib import closing
from pathlib import Path


def copy(source: Path, target: Path, *, lock_timeout: float) -> None:
    """Copy the database at `source` to the new file `target`, one state of it, while others read and write.

    All pages are copied in one step: with a rollback journal, commits wait for it; stepwise copying starts again at
    every commit and need not end. `target` is an empty file until the copy is whole.
    Raises FileExistsError where `target` exists.
    """
    try:
        target.open("xb").close()
    except FileExistsError as error:
        raise FileExistsError(f"the backup's path {target} exists already") from error
    partial = target.with_name(f"{target.name}.partial")
    try:
        _copy_whole(source, partial, lock_timeout)
        partial.replace(target)
    except BaseException:
        partial.unlink(missing_ok=True)
        target.unlink()
        raise


def _copy_whole(source: Path, target: Path, lock_timeout: float) -> None:
    # By its URI, since a plain connect would make the source where it is missing.
    existing = f"{source.absolute().as_uri()}?mode=rw"
    with (
        closing(sqlite3.connect(existing, uri=True, timeout=lock_timeout)) as origin,
        closing(sqlite3.connect(target)) as copied,
    ):
        origin.backup(copied)
        # One file without a log beside it, which any SQLite may open.
        copied.execute("PRAGMA journal_mode=DELETE")
