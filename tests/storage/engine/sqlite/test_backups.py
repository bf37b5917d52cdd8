"""Backups of a file in use, and their restoring."""

import os
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches, raw_columns, runs
from storage.engine.database import Database
from storage.engine.errors import DatabaseBusy, ServiceRuns, StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.sqlite.backup import restore
from storage.engine.sqlite.connect import service_lock
from storage.engine.sqlite.database import back_up
from tests.storage.samples import CLUTCH, OLD, clutch_row, integrity, old_database, revision, store_run, write_to

# --- A copy taken while others write is one state of the database, and never replaces a file.


@pytest.fixture
def busy(tmp_path: Path, journal_mode: str) -> Iterator[Database]:
    del journal_mode
    opened = open_database(f"sqlite:///{tmp_path}/clutches.db")
    with opened.writing() as connection:
        clutches.insert(connection, clutch_row())
        store_run(connection, 0)
    yield opened
    opened.close()


def test_a_copy_while_the_service_writes_is_one_state(busy: Database, tmp_path: Path) -> None:
    done = threading.Event()
    written = []

    def write() -> None:
        number = 1
        while not done.is_set() and number < 2000:
            write_to(busy, store_run, number, length=2000)
            written.append(number)
            number += 1

    writer = threading.Thread(target=write)
    writer.start()
    copies = [tmp_path / f"copy-{number}.db" for number in range(5)]
    try:
        for copy in copies:
            back_up(f"sqlite:///{busy.path}", copy)
    finally:
        done.set()
        writer.join()
    assert written
    for copy in copies:
        assert integrity(copy) == ["ok"]
        with closing(open_database(f"sqlite:///{copy}")) as restored, restored.reading() as connection:
            rows = runs.in_order(connection, CLUTCH)
            clutch = clutches.get(connection, CLUTCH)
            assert clutch.revision == len(rows)
            assert all(
                len(raw_columns.values_of(raw_columns.stored_of_run(connection, row.run_key))) == 3 for row in rows
            )


def test_a_copy_during_an_open_transaction_is_the_state_before_it(busy: Database, tmp_path: Path) -> None:
    with busy.writing() as connection:
        store_run(connection, 1)
        back_up(f"sqlite:///{busy.path}", tmp_path / "copy.db")
    with closing(sqlite3.connect(tmp_path / "copy.db")) as any_sqlite:
        assert any_sqlite.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    assert [path.name for path in tmp_path.glob("copy.db*")] == ["copy.db"], "it is one file"
    with closing(open_database(f"sqlite:///{tmp_path}/copy.db")) as restored, restored.reading() as connection:
        assert len(runs.in_order(connection, CLUTCH)) == 1


def test_an_existing_file_is_never_replaced(busy: Database, tmp_path: Path) -> None:
    (tmp_path / "copy.db").write_text("precious")
    for target in (tmp_path / "copy.db", busy.path):
        before = target.read_bytes()
        with pytest.raises(FileExistsError, match="exists already"):
            back_up(f"sqlite:///{busy.path}", target)
        assert target.read_bytes() == before


def test_a_copy_that_fails_leaves_nothing(busy: Database, tmp_path: Path) -> None:
    busy.path.rename(tmp_path / "moved.db")
    with pytest.raises(StorageUnavailable, match="cannot be opened"):
        back_up(f"sqlite:///{busy.path}", tmp_path / "copy.db")
    assert list(tmp_path.glob("copy.db*")) == []
    assert not busy.path.exists()
    with pytest.raises(FileNotFoundError):
        back_up(f"sqlite:///{busy.path}", tmp_path / "no such folder" / "copy.db")


# --- A backup is put back whole or not at all, and what it replaces is kept.


@pytest.fixture
def url(tmp_path: Path) -> str:
    """A database with two runs, and a backup of it, `backup.db`, with one."""
    address = f"sqlite:///{tmp_path}/a.db"
    with closing(open_database(address)) as database:
        with database.writing() as connection:
            clutches.insert(connection, clutch_row())
            store_run(connection, 0)
        back_up(address, tmp_path / "backup.db")
        write_to(database, store_run, 1)
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
    assert [count(tmp_path / "a.db"), count(kept)] == [1, 3]


def test_a_lost_database_is_restored(url: str, tmp_path: Path) -> None:
    (tmp_path / "a.db").unlink()
    assert restore(url, tmp_path / "backup.db") is None
    assert count(tmp_path / "a.db") == 1


def test_a_damaged_database_is_replaced_and_kept_as_it_is(url: str, tmp_path: Path) -> None:
    (tmp_path / "a.db").write_bytes(b"no database at all" * 1000)
    kept = restore(url, tmp_path / "backup.db")
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
