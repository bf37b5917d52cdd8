"""Whether a database could be read and written now, found out without changing it."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from storage.engine.errors import StorageError
from storage.engine.limits import LEAST_FREE
from storage.engine.transactions import Transactions
from storage.migrations.upgrade import current, head


def is_ready(transactions: Transactions) -> bool:
    """Whether the file is there, answers at the code's revision, has disk space left, and could be written."""
    path = transactions.path
    try:
        with transactions.reading() as connection:
            answers = path.exists() and current(connection) == head()
        return answers and shutil.disk_usage(path.parent).free >= LEAST_FREE and _is_writable(path)
    except (StorageError, OSError):
        return False


def _is_writable(path: Path) -> bool:
    """Whether a transaction may write the first page; it is rolled back. True also while another writer holds the lock."""
    try:
        address = f"{path.resolve().as_uri()}?mode=rw"
        with closing(sqlite3.connect(address, uri=True, timeout=0.0, isolation_level=None)) as connection:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute(f"PRAGMA user_version={connection.execute('PRAGMA user_version').fetchone()[0]}")
            connection.execute("ROLLBACK")
    except sqlite3.Error as error:
        return getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY
    return True
