"""Whether a database could be read and written now, found out without changing it, without a lock and without waiting."""

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from storage.engine.sqlite.connect import JOURNAL_MODE, read_only
from storage.migrations.upgrade import head


def faults(path: Path, *, journal_mode: str, least_free: int) -> dict[str, str]:
    """What is wrong with the file (`database`) and with the space on its disk (`disk`), in words; empty where nothing is.

    `least_free` [byte] is the space that must be free. Who writes now holds nothing up: a reader of the write-ahead log
    waits for no writer, and where there is none a commit in progress shows that the file is in use.
    """
    wrong = {}
    try:
        fault = _fault_of_file(path, journal_mode)
    except OSError as error:
        fault = f"the file cannot be read: {error.strerror}"
    if fault is not None:
        wrong["database"] = fault
    try:
        free = shutil.disk_usage(path.parent).free
    except OSError as error:
        wrong["disk"] = f"the disk does not answer: {error.strerror}"
    else:
        if free < least_free:
            wrong["disk"] = f"{free >> 20} MiB are free on the database's disk, {least_free >> 20} are needed"
    return wrong


def _fault_of_file(path: Path, journal_mode: str) -> str | None:
    """What is wrong with the file: it is not there, does not answer at the code's revision, or may not be written."""
    if not path.exists():
        return "the file is not there"
    try:
        with closing(sqlite3.connect(read_only(path), uri=True, timeout=0.0)) as connection:
            (revision,) = connection.execute("SELECT version_num FROM alembic_version").fetchone()
    except sqlite3.Error as error:
        busy = getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY
        if journal_mode == JOURNAL_MODE or not busy:
            return f"the file cannot be read: {error}"
    else:
        if revision != head():
            return f"the file is at revision {revision}, this release needs {head()}"
    if not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)):
        return "the file or its folder cannot be written"
    return None
