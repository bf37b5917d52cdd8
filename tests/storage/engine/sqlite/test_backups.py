"""A copy taken while others write is one state of the database, and never replaces a file."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from storage import channels, clutches, runs
from storage.engine.database import Database
from storage.engine.errors import StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.sqlite.database import back_up
from tests.storage.samples import OLD, clutch_row, integrity, old_database, revision, store_run

CLUTCH = "bench3-017"


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
            with busy.writing() as connection:
                store_run(connection, number, length=2000)
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
            assert clutch is not None
            assert clutch.revision == len(rows)
            assert all(len(channels.read(connection, row.run_key)) == 3 for row in rows)


def test_a_copy_during_an_open_transaction_is_the_state_before_it(busy: Database, tmp_path: Path) -> None:
    with busy.writing() as connection:
        store_run(connection, 1)
        back_up(f"sqlite:///{busy.path}", tmp_path / "copy.db")
    with closing(open_database(f"sqlite:///{tmp_path}/copy.db")) as restored, restored.reading() as connection:
        assert len(runs.in_order(connection, CLUTCH)) == 1


def test_a_copy_is_one_file_for_any_sqlite(busy: Database, tmp_path: Path) -> None:
    back_up(f"sqlite:///{busy.path}", tmp_path / "copy.db")
    with closing(sqlite3.connect(tmp_path / "copy.db")) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    assert [path.name for path in sorted(tmp_path.glob("copy.db*"))] == ["copy.db"]


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


def test_a_backup_of_an_older_file_is_made_as_it_is(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    before = path.read_bytes()
    back_up(f"sqlite:///{path}", tmp_path / "copy.db")
    assert path.read_bytes() == before
    assert [revision(each) for each in (path, tmp_path / "copy.db")] == [OLD, OLD]
    assert integrity(tmp_path / "copy.db") == ["ok"]
