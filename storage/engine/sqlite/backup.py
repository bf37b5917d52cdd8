"""A consistent copy of a database in use, by SQLite's online backup (https://www.sqlite.org/backup.html).

The source is only read, at whatever revision it is.
"""

import filecmp
import itertools
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from storage.engine.sqlite.connect import read_only
from storage.engine.sqlite.private_files import make_if_missing, make_new


def copy(source: Path, target: Path, *, lock_timeout: float) -> None:
    """Copy the database at `source` to the new file `target`, one state of it, while others read and write.

    All pages are copied in one step: with a rollback journal, commits wait for it; stepwise copying starts again at
    every commit and need not end. `target` is an empty file until the copy is whole.
    Raises FileExistsError where `target` exists.
    """
    try:
        make_new(target)
    except FileExistsError as error:
        raise FileExistsError(f"the backup's path {target} exists already") from error
    partial = target.with_name(f"{target.name}.partial")
    try:
        make_if_missing(partial)
        copy_whole(source, partial, lock_timeout)
        renamed(partial, target)
    except BaseException:
        partial.unlink(missing_ok=True)
        target.unlink()
        raise


def copy_beside(source: Path, suffix: str, *, lock_timeout: float) -> Path:
    """Copy the database at `source` to `FILE-suffix`, or to `FILE-suffix.2` and so on where that holds something else.

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
    """`FILE-suffix`, then `FILE-suffix.2`, `FILE-suffix.3`, and so on without end."""
    yield path.with_name(f"{path.name}-{suffix}")
    yield from (path.with_name(f"{path.name}-{suffix}.{number}") for number in itertools.count(2))


def renamed(path: Path, target: Path) -> Path:
    """Give a file another name, in place of what has it, so that a power cut leaves the one or the other; the new name."""
    path.replace(target)
    folder = os.open(target.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return target


def copy_whole(source: Path, target: Path, lock_timeout: float) -> None:
    """Copy the database at `source` into the new file `target`, which is whole only at the end."""
    with (
        closing(sqlite3.connect(read_only(source), uri=True, timeout=lock_timeout)) as origin,
        closing(sqlite3.connect(target)) as copied,
    ):
        origin.backup(copied)
        # One file without a log beside it, which any SQLite may open.
        copied.execute("PRAGMA journal_mode=DELETE")
