"""A backup is put back whole or not at all, and what it replaces is kept."""

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches, runs
from storage.engine.errors import DatabaseBusy, ServiceRuns, StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.sqlite.backup import restore
from storage.engine.sqlite.connect import service_lock
from storage.engine.sqlite.database import back_up
from tests.storage.samples import OLD, clutch_row, integrity, old_database, revision, store_run

CLUTCH = "bench3-017"


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A database with two runs, and a backup of it, `backup.db`, with one."""
    address = f"sqlite:///{tmp_path}/a.db"
    with closing(open_database(address)) as database:
        with database.writing() as connection:
            clutches.insert(connection, clutch_row())
            store_run(connection, 0)
        back_up(address, tmp_path / "backup.db")
        with database.writing() as connection:
            store_run(connection, 1)
    return address


def count(path: Path) -> int:
    assert integrity(path) == ["ok"]
    with closing(open_database(f"sqlite:///{path}")) as database, database.reading() as connection:
        return len(runs.in_order(connection, CLUTCH))


def test_a_restored_backup_is_in_place_and_the_replaced_file_is_kept(url: str, tmp_path: Path) -> None:
    path, backup = tmp_path / "a.db", tmp_path / "backup.db"
    kept = restore(url, backup)
    again = restore(url, backup)
    assert (kept, again) == (tmp_path / "a.db-replaced", tmp_path / "a.db-replaced.2")
    assert kept is not None
    assert again is not None
    assert [count(each) for each in (path, backup, kept, again)] == [1, 1, 2, 1]


def test_commits_that_are_only_in_the_log_are_kept_too(url: str, tmp_path: Path) -> None:
    """A killed service leaves them there; the restored file must not take them for its own."""
    if (child := os.fork()) == 0:
        with open_database(url).writing() as connection:
            store_run(connection, 2)
        os._exit(0)
    os.waitpid(child, 0)
    assert (tmp_path / "a.db-wal").stat().st_size > 0
    kept = restore(url, tmp_path / "backup.db")
    assert kept is not None
    assert [count(tmp_path / "a.db"), count(kept)] == [1, 3]


def test_a_lost_database_is_restored(url: str, tmp_path: Path) -> None:
    (tmp_path / "a.db").unlink()
    assert restore(url, tmp_path / "backup.db") is None
    assert count(tmp_path / "a.db") == 1


def test_a_damaged_database_is_replaced_and_kept_as_it_is(url: str, tmp_path: Path) -> None:
    (tmp_path / "a.db").write_bytes(b"no database at all" * 1000)
    kept = restore(url, tmp_path / "backup.db")
    assert kept is not None
    assert kept.read_bytes() == b"no database at all" * 1000
    assert count(tmp_path / "a.db") == 1


def test_an_older_backup_is_restored_at_its_revision(url: str, tmp_path: Path) -> None:
    restore(url, old_database(tmp_path))
    assert revision(tmp_path / "a.db") == OLD


def test_what_is_in_use_is_not_replaced(url: str, tmp_path: Path) -> None:
    with service_lock(tmp_path / "a.db"), pytest.raises(ServiceRuns, match="stop it first"):
        restore(url, tmp_path / "backup.db")
    with closing(open_database(url)) as other, other.reading() as connection:
        runs.in_order(connection, CLUTCH)
        with pytest.raises(DatabaseBusy, match="has the database open"):
            restore(url, tmp_path / "backup.db")
    assert count(tmp_path / "a.db") == 2
    assert list(tmp_path.glob("*replaced*")) == list(tmp_path.glob("*partial*")) == []


def test_what_is_no_whole_database_is_refused(url: str, tmp_path: Path) -> None:
    backup = tmp_path / "backup.db"
    whole = backup.read_bytes()
    cut = tmp_path / "cut.db"
    cut.write_bytes(whole[: len(whole) // 2])
    text = tmp_path / "text.db"
    text.write_text("not a database, but long enough to have a header" * 9)
    foreign = tmp_path / "foreign.db"
    with closing(sqlite3.connect(foreign)) as connection:
        connection.execute("CREATE TABLE ball (colour TEXT)")
    for bad in (cut, text, foreign):
        with pytest.raises(StorageUnavailable, match=bad.name):
            restore(url, bad)
    with pytest.raises(FileNotFoundError, match="no backup"):
        restore(url, tmp_path / "none.db")
    with pytest.raises(ValueError, match="the database itself"):
        restore(url, tmp_path / "a.db")
    assert count(tmp_path / "a.db") == 2
    assert list(tmp_path.glob("*replaced*")) == list(tmp_path.glob("*partial*")) == []
