"""Whether a file is whole: its pages and indexes, and the references between its rows.

Source: https://www.sqlite.org/pragma.html#pragma_integrity_check.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

from sqlalchemy import Connection

from storage.engine.sqlite.connect import read_only

#: Findings of one kind that are listed. Chosen: a screenful; SQLite's own default is 100.
_MOST_LISTED = 20


def damage(connection: Connection) -> list[str]:
    """What is wrong with the pages, the indexes and the references of a database; empty where nothing is."""
    pages = [str(row[0]) for row in connection.exec_driver_sql(f"PRAGMA integrity_check({_MOST_LISTED})")]
    broken = connection.exec_driver_sql("PRAGMA foreign_key_check").fetchmany(_MOST_LISTED)
    return [f"integrity: {line}" for line in pages if line != "ok"] + [
        f"row {row} of {table} refers to a row of {other} that is missing" for table, row, other, _ in broken
    ]


def require_whole(path: Path) -> None:
    """Raise sqlite3.DatabaseError unless the file at `path` is a whole database of this program, at whatever revision."""
    with closing(sqlite3.connect(read_only(path), uri=True)) as connection:
        (line,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
        if line != "ok":
            raise sqlite3.DatabaseError(f"it is damaged: {line}")
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'alembic_version'").fetchone():
            raise sqlite3.DatabaseError("it is not a database of this program")
