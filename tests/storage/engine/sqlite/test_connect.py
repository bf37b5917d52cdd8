"""The file's address, its journal mode and the settings of every connection."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.engine.sqlite.database import back_up
from tests.storage.samples import clutch_row


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
        patch.setattr("storage.engine.sqlite.connect.JOURNAL_MODE", earlier)
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
        ("sqlite:///a.db?key=secret", "without options"),
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
            assert not database.faults(least_free=0)
            back_up(f"sqlite:///{name}", tmp_path / f"copy of {name}")
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
