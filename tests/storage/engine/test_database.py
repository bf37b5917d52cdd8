"""Opening, refusing, and what the store says where the file cannot be used."""

import contextlib
import sqlite3
import time
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from storage import clutches
from storage.engine.database import LEAST_FREE, Database, open_database, preferred_journal_mode
from storage.engine.errors import StorageUnavailable
from tests.storage.samples import clutch_row, store_run


@pytest.mark.parametrize(
    ("version", "mode"),
    [
        ((3, 40, 1), "delete"),
        ((3, 51, 2), "delete"),
        ((3, 51, 3), "wal"),
        ((3, 51, 10), "wal"),
        ((3, 52, 0), "wal"),
        ((4, 0, 0), "wal"),
    ],
)
def test_journal_mode_of_a_release(version: tuple[int, ...], mode: str) -> None:
    assert preferred_journal_mode(version) == mode


def journal_mode_of_file(path: Path) -> str:
    with closing(sqlite3.connect(path)) as connection:
        return str(connection.execute("PRAGMA journal_mode").fetchone()[0])


def test_the_file_is_in_the_mode_that_is_wanted(tmp_path: Path, journal_mode: str) -> None:
    with closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        assert database.journal_mode == journal_mode
        assert journal_mode_of_file(tmp_path / "a.db") == journal_mode


@pytest.mark.parametrize("earlier", ["delete", "wal"])
def test_a_file_of_another_sqlite_is_turned_and_keeps_its_rows(
    tmp_path: Path, journal_mode: str, earlier: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = f"sqlite:///{tmp_path}/a.db"
    with monkeypatch.context() as patch:
        patch.setattr("storage.engine.database.preferred_journal_mode", lambda _: earlier)
        with closing(open_database(url)) as database, database.writing() as connection:
            clutches.insert(connection, clutch_row())
    assert journal_mode_of_file(tmp_path / "a.db") == earlier
    with closing(open_database(url)) as database, database.reading() as connection:
        assert database.journal_mode == journal_mode
        assert clutches.get(connection, "bench3-017") == clutch_row()
    assert journal_mode_of_file(tmp_path / "a.db") == journal_mode


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("postgresql://user:secret@host/db", "'postgresql'"),
        ("sqlite+aiosqlite:///a.db", r"'sqlite\+aiosqlite'"),
        ("clutches.db", "sqlite:///path"),
        ("", "sqlite:///path"),
        ("sqlite://", "needs a file"),
        ("sqlite:///", "needs a file"),
        ("sqlite://host/a.db", "needs a file"),
        ("sqlite:///:memory:", "needs a file"),
        ("sqlite:///a.db?mode=ro", "without options"),
        ("sqlite:///file:a.db", "without options"),
    ],
)
def test_other_addresses_are_refused(url: str, says: str) -> None:
    with pytest.raises(ValueError, match=says) as refusal:
        open_database(url)
    assert "secret" not in str(refusal.value)


def test_relative_paths_and_paths_with_signs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("plain.db", "50 % of # ü.db"):
        with closing(open_database(f"sqlite:///{name}")) as database:
            assert database.ready()
            database.backup(tmp_path / f"copy of {name}")
        assert {(tmp_path / name).exists(), (tmp_path / f"copy of {name}").exists()} == {True}


def test_every_connection_enforces_keys_and_syncs(database: Database) -> None:
    expected = {"foreign_keys": 1, "synchronous": 2, "cache_spill": 0, "busy_timeout": 10_000}
    for block in (database.reading, database.writing):
        with block() as first, database.reading() as second:
            for connection in (first, second):
                found = {name: connection.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in expected}
                assert found == expected
                driver = connection.connection.driver_connection
                assert isinstance(driver, sqlite3.Connection)
                assert driver.isolation_level is None


def test_an_unreachable_file_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "no such folder" / "a.db", tmp_path):
        with pytest.raises(StorageUnavailable, match="cannot be opened") as failure:
            open_database(f"sqlite:///{path}")
        assert str(path) in str(failure.value)


def test_a_file_that_is_no_database_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a database, " * 100)
    with pytest.raises(StorageUnavailable, match="is not a database"):
        open_database(f"sqlite:///{path}")
    assert path.read_text() == "not a database, " * 100


def test_a_damaged_file_is_said_to_be_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with closing(open_database(f"sqlite:///{path}")) as database, database.writing() as connection:
        clutches.insert(connection, clutch_row())
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    path.write_bytes(content)
    with pytest.raises(StorageUnavailable, match="damaged"):
        open_database(f"sqlite:///{path}")


def test_a_full_disk_changes_nothing(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())

    def overfill() -> None:
        with database.writing() as connection:
            pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
            connection.exec_driver_sql(f"PRAGMA max_page_count={pages}")
            store_run(connection, 0, length=10_000)

    with pytest.raises(StorageUnavailable, match="full"):
        overfill()
    with database.writing() as connection:
        connection.exec_driver_sql("PRAGMA max_page_count=1000000")
        assert clutches.get(connection, "bench3-017") == clutch_row()
        store_run(connection, 0, length=10_000)


def test_a_read_only_database_is_said_to_be_so(database: Database) -> None:
    def write() -> None:
        with database.writing() as connection:
            connection.exec_driver_sql("PRAGMA query_only=ON")
            clutches.insert(connection, clutch_row())

    with pytest.raises(StorageUnavailable, match="read-only"):
        write()


def test_a_mistake_in_the_program_is_not_disguised(database: Database) -> None:
    with pytest.raises(OperationalError, match="no such table"), database.reading() as connection:
        connection.execute(text("SELECT * FROM no_such"))


def test_ready_while_the_file_is_there_and_open(database: Database) -> None:
    assert database.ready()
    database.path.rename(database.path.with_suffix(".gone"))
    assert not database.ready()
    database.path.with_suffix(".gone").rename(database.path)
    assert database.ready()
    database.close()
    assert not database.ready()


def test_not_ready_on_a_full_disk(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("storage.engine.database.shutil.disk_usage", lambda _: SimpleNamespace(free=LEAST_FREE - 1))
    assert not database.ready()
    monkeypatch.setattr("storage.engine.database.shutil.disk_usage", lambda _: SimpleNamespace(free=LEAST_FREE))
    assert database.ready()


def test_not_ready_where_nothing_can_be_written(
    tmp_path: Path, journal_mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SQLite itself refuses to write what it was told to open for reading, as it does on a disk that is read-only."""
    connect = sqlite3.connect

    def read_only(address: str, **how: Any) -> sqlite3.Connection:
        assert address.endswith("?mode=rw")
        return connect(address.replace("?mode=rw", "?mode=ro"), **how)

    with closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        assert database.journal_mode == journal_mode
        assert database.ready()
        with monkeypatch.context() as patch:
            patch.setattr("storage.engine.database.sqlite3.connect", read_only)
            assert not database.ready()
        assert database.ready()


def test_ready_writes_nothing_and_waits_for_nobody(database: Database) -> None:
    before = (database.path.read_bytes(), sorted(path.name for path in database.path.parent.iterdir()))
    for _ in range(20):
        assert database.ready()
    assert (database.path.read_bytes(), sorted(path.name for path in database.path.parent.iterdir())) == before
    with database.writing():
        begun = time.monotonic()
        assert database.ready(), "who writes now can write"
        assert time.monotonic() - begun < 1.0


def test_a_closed_database_says_so(database: Database, tmp_path: Path) -> None:
    database.close()
    database.close()
    with pytest.raises(StorageUnavailable, match="has been closed"), database.reading():
        pass
    with pytest.raises(StorageUnavailable, match="has been closed"), database.writing():
        pass
    with pytest.raises(StorageUnavailable, match="has been closed"):
        database.backup(tmp_path / "copy.db")


def test_the_version_changes_with_every_commit_and_with_nothing_else(database: Database) -> None:
    seen = [database.version(), database.version()]
    with database.writing() as connection:
        connection.exec_driver_sql("CREATE TABLE extra (x)")
        seen.append(database.version())  # not committed yet
    assert len(set(seen)) == 1
    seen.append(database.version())
    with contextlib.suppress(RuntimeError), database.writing() as connection:
        connection.exec_driver_sql("INSERT INTO extra VALUES (1)")
        raise RuntimeError
    assert database.version() == seen[-1] != seen[0]
    with database.reading() as connection:
        connection.exec_driver_sql("SELECT * FROM extra").fetchall()
    assert database.version() == seen[-1]
    other = open_database(f"sqlite:///{database.path}")
    with other.writing() as connection:
        connection.exec_driver_sql("INSERT INTO extra VALUES (2)")
    assert database.version() not in seen
    other.close()
