"""A copy taken while others write is one state of the database, and never replaces a file."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from storage import channels, clutches, runs
from storage.engine.database import Database, open_database
from storage.engine.errors import StorageUnavailable
from tests.storage.samples import clutch_row, integrity, store_run

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
            busy.backup(copy)
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
        busy.backup(tmp_path / "copy.db")
    with closing(open_database(f"sqlite:///{tmp_path}/copy.db")) as restored, restored.reading() as connection:
        assert len(runs.in_order(connection, CLUTCH)) == 1


def test_a_copy_is_one_file_for_any_sqlite(busy: Database, tmp_path: Path) -> None:
    busy.backup(tmp_path / "copy.db")
    with closing(sqlite3.connect(tmp_path / "copy.db")) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    assert [path.name for path in sorted(tmp_path.glob("copy.db*"))] == ["copy.db"]


def test_an_existing_file_is_never_replaced(busy: Database, tmp_path: Path) -> None:
    (tmp_path / "copy.db").write_text("precious")
    for target in (tmp_path / "copy.db", busy.path):
        before = target.read_bytes()
        with pytest.raises(FileExistsError, match="exists already"):
            busy.backup(target)
        assert target.read_bytes() == before


def test_a_copy_that_fails_leaves_nothing(busy: Database, tmp_path: Path) -> None:
    busy.path.rename(tmp_path / "moved.db")
    with pytest.raises(StorageUnavailable, match="cannot be opened"):
        busy.backup(tmp_path / "copy.db")
    assert list(tmp_path.glob("copy.db*")) == []
    assert not busy.path.exists()
    with pytest.raises(FileNotFoundError):
        busy.backup(tmp_path / "no such folder" / "copy.db")
