"""Ready: the file is there, answers, has room and can be written; the question changes nothing."""

import multiprocessing
import os
import sqlite3
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.support import one_quick

#: Bytes that must be free in these tests.
LEAST_FREE = 16 << 20


def test_ready_while_the_file_is_there_and_open(database: Database) -> None:
    assert not database.faults(least_free=LEAST_FREE)
    database.path.rename(database.path.with_suffix(".gone"))
    assert database.faults(least_free=LEAST_FREE)
    database.path.with_suffix(".gone").rename(database.path)
    assert not database.faults(least_free=LEAST_FREE)
    database.close()
    assert database.faults(least_free=LEAST_FREE)


def test_not_ready_on_a_full_disk(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "storage.engine.sqlite.database.shutil.disk_usage", lambda _: SimpleNamespace(free=LEAST_FREE - 1)
    )
    assert database.faults(least_free=LEAST_FREE)
    monkeypatch.setattr("storage.engine.sqlite.database.shutil.disk_usage", lambda _: SimpleNamespace(free=LEAST_FREE))
    assert not database.faults(least_free=LEAST_FREE)


def test_not_ready_where_nothing_can_be_written(
    tmp_path: Path, journal_mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a disk that was mounted again for reading only, where the system refuses root too."""
    access = os.access
    with closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        assert database.journal_mode == journal_mode
        assert not database.faults(least_free=LEAST_FREE)
        for unwritable in (database.path, database.path.parent):
            with monkeypatch.context() as patch:
                patch.setattr(
                    "storage.engine.sqlite.database.os.access",
                    lambda path, how, no=unwritable: path != no and access(path, how),
                )
                assert database.faults(least_free=LEAST_FREE) == {
                    "database": "the file or its folder cannot be written"
                }
        assert not database.faults(least_free=LEAST_FREE)


def test_a_file_that_is_no_database_is_said_to_be_unreadable(database: Database) -> None:
    database.path.write_bytes(b"x" * 8192)
    assert "cannot be read" in database.faults(least_free=LEAST_FREE)["database"]


def test_ready_writes_nothing_and_waits_for_nobody(database: Database) -> None:
    def files() -> dict[str, bytes]:  # but for the log's index, which holds the marks of those who read
        return {path.name: path.read_bytes() for path in database.path.parent.iterdir() if path.suffix != ".db-shm"}

    assert not database.faults(least_free=LEAST_FREE)
    before = files()
    for _ in range(20):
        assert not database.faults(least_free=LEAST_FREE)
    assert files() == before
    with database.writing():
        begun = time.monotonic()
        assert not database.faults(least_free=LEAST_FREE), "who writes now can write"
        assert time.monotonic() - begun < 5.0


def _hold(path: str, begin: str, say: "multiprocessing.connection.Connection") -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(begin)
        say.send("held")
        say.recv()


@pytest.mark.parametrize("begin", one_quick(["BEGIN EXCLUSIVE", "BEGIN IMMEDIATE"]))
def test_ready_at_once_while_another_process_holds_the_lock(tmp_path: Path, journal_mode: str, begin: str) -> None:
    spawn = multiprocessing.get_context("spawn")
    with closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        assert database.journal_mode == journal_mode
        ours, theirs = spawn.Pipe()
        other = spawn.Process(target=_hold, args=(str(database.path), begin, theirs))
        other.start()
        assert ours.poll(60)
        assert ours.recv() == "held"
        begun = time.monotonic()
        wrong = database.faults(least_free=LEAST_FREE)
        assert time.monotonic() - begun < 5.0
        assert wrong == {}
        ours.send("end")
        other.join(60)
