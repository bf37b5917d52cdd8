"""A database in a file: its address and settings, who waits for whom, and what is said where it cannot be used."""

import multiprocessing
import os
import sqlite3
import stat
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from storage import clutches, runs
from storage.engine.database import Database
from storage.engine.errors import DatabaseBusy, DatabaseTooOld, StorageUnavailable
from storage.engine.opening import find_database, open_database, service_lock
from storage.engine.sqlite import connect
from storage.engine.sqlite.backup import copy
from storage.engine.sqlite.database import back_up
from tests.storage.samples import CLUTCH, OLD, clutch_row, integrity, old_database, read_from, store_run, write_to
from tests.support import one_quick

# --- Address, journal mode and the settings of every connection.


def journal_mode_of_file(path: Path) -> str:
    with closing(sqlite3.connect(path)) as connection:
        return str(connection.execute("PRAGMA journal_mode").fetchone()[0])


@pytest.mark.parametrize("earlier", ["delete", "wal"])
def test_a_file_of_another_sqlite_is_turned_and_keeps_its_rows(
    tmp_path: Path, journal_mode: str, earlier: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = f"sqlite:///{tmp_path}/a.db"
    with monkeypatch.context() as patch:
        patch.setattr(connect, "JOURNAL_MODE", earlier)
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


# --- Transactions: what both kinds of database have is in tests/storage/engine/test_transactions.py.


def test_beside_a_rollback_journal_a_commit_waits_for_readers_gives_up_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connect, "JOURNAL_MODE", "delete")
    with closing(open_database(f"sqlite:///{tmp_path}/a.db", lock_timeout=0.1)) as impatient:
        write_to(impatient, clutches.insert, clutch_row())
        with impatient.reading() as reader:
            assert runs.in_order(reader, CLUTCH) == []
            with pytest.raises(DatabaseBusy, match="locked"), impatient.writing() as connection:
                store_run(connection, 0)
            assert runs.in_order(reader, CLUTCH) == []
        with impatient.writing() as connection:
            assert runs.in_order(connection, CLUTCH) == []
            store_run(connection, 1)
        assert integrity(impatient.path) == ["ok"]


def test_a_writer_elsewhere_makes_the_database_busy(tmp_path: Path, journal_mode: str) -> None:
    with (
        closing(open_database(f"sqlite:///{tmp_path}/a.db", lock_timeout=0.1)) as impatient,
        closing(sqlite3.connect(tmp_path / "a.db", isolation_level=None)) as other,
    ):
        assert impatient.journal_mode == journal_mode
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(DatabaseBusy, match="locked"), impatient.writing():
            pytest.fail("two writers at once")
        assert read_from(impatient, clutches.all_ids) == []
        other.execute("ROLLBACK")
        write_to(impatient, clutches.insert, clutch_row())


# --- Where the file cannot be used.


def test_what_cannot_be_opened_is_named_and_left_alone(tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("not a database, " * 100)
    for opening, path, says in (
        (open_database, tmp_path / "no such folder" / "a.db", "cannot be opened"),
        (open_database, tmp_path, "cannot be opened"),
        (open_database, notes, "is not a database"),
        (find_database, tmp_path / "none.db", "cannot be opened"),
    ):
        with pytest.raises(StorageUnavailable, match=says) as failure:
            opening(f"sqlite:///{path}")
        assert str(path) in str(failure.value)
    assert notes.read_text() == "not a database, " * 100
    assert [each.name for each in tmp_path.iterdir()] == ["notes.txt"]


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
    write_to(database, clutches.insert, clutch_row())

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


def test_a_mistake_in_the_program_is_not_disguised(database: Database) -> None:
    with pytest.raises(OperationalError, match="no such table"), database.reading() as connection:
        connection.execute(text("SELECT * FROM no_such"))


@pytest.mark.usefixtures("later_step")
def test_a_found_database_is_read_at_its_own_revision_and_never_changed(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    before = path.read_bytes()
    with closing(find_database(f"sqlite:///{path}")) as found:
        with found.reading() as connection:
            assert connection.exec_driver_sql("SELECT count(*) FROM clutch").scalar() == 1
        with pytest.raises(DatabaseTooOld, match=rf"{OLD}, this program needs s\d{{4}}_.*clutchlife serve"):  # noqa: SIM117
            with found.reading() as connection:
                connection.exec_driver_sql("SELECT later FROM clutch")
        with pytest.raises(StorageUnavailable, match="read-only"), found.writing() as connection:
            connection.exec_driver_sql("DELETE FROM clutch")
    assert path.read_bytes() == before


# --- Ready: the file is there, answers, has room and can be written; the question changes nothing.

#: Bytes that must be free in these tests.
LEAST_FREE = 16 << 20


def test_ready_while_the_file_is_there_readable_and_open(database: Database) -> None:
    assert not database.faults(least_free=LEAST_FREE)
    database.path.rename(database.path.with_suffix(".gone"))
    assert database.faults(least_free=LEAST_FREE)
    database.path.with_suffix(".gone").rename(database.path)
    assert not database.faults(least_free=LEAST_FREE)
    database.path.write_bytes(b"x" * 8192)
    assert "cannot be read" in database.faults(least_free=LEAST_FREE)["database"]
    database.close()
    assert database.faults(least_free=LEAST_FREE)


def test_not_ready_on_a_full_disk(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    for free, full in ((LEAST_FREE - 1, True), (LEAST_FREE, False)):
        disk = SimpleNamespace(free=free)
        monkeypatch.setattr("storage.engine.sqlite.database.shutil.disk_usage", lambda _, disk=disk: disk)
        assert bool(database.faults(least_free=LEAST_FREE)) == full


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


def test_ready_writes_nothing_and_waits_for_nobody(database: Database) -> None:
    def files() -> dict[str, bytes]:  # but for the log's index, which holds the marks of those who read
        return {path.name: path.read_bytes() for path in database.path.parent.iterdir() if path.suffix != ".db-shm"}

    assert not database.faults(least_free=LEAST_FREE)
    before = files()
    for _ in range(20):
        assert not database.faults(least_free=LEAST_FREE)
    assert files() == before
    with database.writing():
        assert not database.faults(least_free=LEAST_FREE), "who writes now can write"


def _hold(path: str, begin: str, say: "multiprocessing.connection.Connection") -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(begin)
        say.send("held")
        say.recv()


@pytest.mark.parametrize("begin", one_quick(["BEGIN EXCLUSIVE", "BEGIN IMMEDIATE"]))
def test_ready_at_once_while_another_process_holds_the_lock(tmp_path: Path, journal_mode: str, begin: str) -> None:
    spawn = multiprocessing.get_context("spawn")
    with closing(open_database(f"sqlite:///{tmp_path}/a.db", lock_timeout=600.0)) as database:
        assert database.journal_mode == journal_mode
        ours, theirs = spawn.Pipe()
        other = spawn.Process(target=_hold, args=(str(database.path), begin, theirs))
        other.start()
        assert ours.poll(60)
        assert ours.recv() == "held"
        with ThreadPoolExecutor(1) as pool:
            looking = pool.submit(database.faults, least_free=LEAST_FREE)
            assert looking.result(timeout=60) == {}
        ours.send("end")
        other.join(60)


# --- What keys protect is not readable by other users of the machine: the database, its log, its lock and its backups.


@pytest.fixture
def _open_to_all() -> Iterator[None]:
    """The mask of a careless machine, under which what is made without a mode is open to all."""
    before = os.umask(0)
    yield
    os.umask(before)


def modes(folder: Path) -> dict[str, str]:
    return {path.name: oct(stat.S_IMODE(path.stat().st_mode)) for path in folder.iterdir()}


@pytest.mark.usefixtures("_open_to_all")
def test_other_users_read_no_file_of_a_new_database_but_a_mode_that_an_operator_chose_stays(tmp_path: Path) -> None:
    with service_lock(f"sqlite:///{tmp_path}/a.db"), closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        write_to(database, clutches.insert, clutch_row())
        copy(tmp_path / "a.db", tmp_path / "backup.db", lock_timeout=1.0)
        found = modes(tmp_path)
    assert {"a.db", "a.db-wal", "a.db-shm", "a.db-lock", "a.db-service", "backup.db"} <= found.keys()
    assert set(found.values()) == {"0o600"}
    (tmp_path / "control").touch()
    assert modes(tmp_path)["control"] == "0o666", "the mask hides what is to be seen"
    (tmp_path / "a.db").chmod(0o640)
    open_database(f"sqlite:///{tmp_path}/a.db").close()
    assert modes(tmp_path)["a.db"] == "0o640"
