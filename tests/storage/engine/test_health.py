"""Ready: the file is there, answers, has room and can be written; the question changes nothing."""

import sqlite3
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from storage.engine.database import Database, open_database
from storage.engine.limits import LEAST_FREE


def test_ready_while_the_file_is_there_and_open(database: Database) -> None:
    assert database.ready()
    database.path.rename(database.path.with_suffix(".gone"))
    assert not database.ready()
    database.path.with_suffix(".gone").rename(database.path)
    assert database.ready()
    database.close()
    assert not database.ready()


def test_not_ready_on_a_full_disk(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("storage.engine.health.shutil.disk_usage", lambda _: SimpleNamespace(free=LEAST_FREE - 1))
    assert not database.ready()
    monkeypatch.setattr("storage.engine.health.shutil.disk_usage", lambda _: SimpleNamespace(free=LEAST_FREE))
    assert database.ready()


def test_not_ready_where_nothing_can_be_written(
    tmp_path: Path, journal_mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite itself refuses to write a file that is open for reading only, as it does on a disk that is read-only."""
    connect = sqlite3.connect

    def read_only(address: str, **how: Any) -> sqlite3.Connection:
        assert address.endswith("?mode=rw")
        return connect(address.replace("?mode=rw", "?mode=ro"), **how)

    with closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        assert database.journal_mode == journal_mode
        assert database.ready()
        with monkeypatch.context() as patch:
            patch.setattr("storage.engine.health.sqlite3.connect", read_only)
            assert not database.ready()
        assert database.ready()


def test_ready_writes_nothing_and_waits_for_nobody(database: Database) -> None:
    def files() -> dict[str, bytes]:  # but for the log's index, which holds the marks of those who read
        return {path.name: path.read_bytes() for path in database.path.parent.iterdir() if path.suffix != ".db-shm"}

    assert database.ready()
    before = files()
    for _ in range(20):
        assert database.ready()
    assert files() == before
    with database.writing():
        begun = time.monotonic()
        assert database.ready(), "who writes now can write"
        assert time.monotonic() - begun < 1.0
