"""Writers queue, readers see one state, and what fails leaves nothing behind."""

import sqlite3
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches, runs
from storage.engine.database import Database
from storage.engine.errors import DatabaseBusy
from storage.engine.opening import open_database
from tests.storage.samples import child, clutch_row, integrity, store_run

CLUTCH = "bench3-017"

WRITER = """
import sys
import storage.engine.sqlite.connect
import storage.engine.opening
from tests.storage.samples import store_run
path, mode, first, number = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
storage.engine.sqlite.connect.JOURNAL_MODE = mode
database = storage.engine.opening.open_database(f"sqlite:///{path}")
print("open", flush=True)
sys.stdin.readline()
for each in range(first, first + number):
    with database.writing() as connection:
        store_run(connection, each)
database.close()
print("done", flush=True)
"""


@pytest.fixture
def impatient(tmp_path: Path, journal_mode: str) -> Iterator[Database]:
    """A database with one clutch that gives up on a lock after a tenth of a second."""
    del journal_mode
    opened = open_database(f"sqlite:///{tmp_path}/clutches.db", lock_timeout=0.1)
    with opened.writing() as connection:
        clutches.insert(connection, clutch_row())
    yield opened
    opened.close()


def stored_runs(database: Database) -> int:
    with database.reading() as connection:
        return len(runs.in_order(connection, CLUTCH))


class Interrupted(BaseException):
    pass


@pytest.mark.parametrize("failure", [RuntimeError, Interrupted, GeneratorExit])
def test_any_exception_rolls_back_and_passes(impatient: Database, failure: type[BaseException]) -> None:
    def fail() -> None:
        with impatient.writing() as connection:
            store_run(connection, 0)
            raise failure

    with pytest.raises(failure):
        fail()
    assert stored_runs(impatient) == 0
    with impatient.writing() as connection:
        store_run(connection, 0)
    assert stored_runs(impatient) == 1


@pytest.mark.parametrize("length", [40, 500_000])
def test_a_reader_during_a_write_sees_the_old_state(impatient: Database, length: int) -> None:
    """Also while the transaction is far larger than SQLite's page cache of 2 MB."""
    with impatient.writing() as connection:
        store_run(connection, 0, length=length)
        assert len(runs.in_order(connection, CLUTCH)) == 1
        assert stored_runs(impatient) == 0
    assert stored_runs(impatient) == 1


def test_a_reader_keeps_its_state_while_another_process_may_not_commit_or_it_is_not_seen(impatient: Database) -> None:
    """With a log the commit passes the reader by; with a rollback journal it waits, gives up and leaves nothing."""
    with impatient.reading() as reader:
        assert runs.in_order(reader, CLUTCH) == []
        if impatient.journal_mode == "wal":
            with impatient.writing() as connection:
                store_run(connection, 0)
        else:
            with pytest.raises(DatabaseBusy, match="locked"), impatient.writing() as connection:
                store_run(connection, 0)
        assert runs.in_order(reader, CLUTCH) == []
    assert stored_runs(impatient) == (1 if impatient.journal_mode == "wal" else 0)
    with impatient.writing() as connection:
        store_run(connection, 1)
    assert integrity(impatient.path) == ["ok"]


def test_a_writer_elsewhere_makes_the_database_busy(impatient: Database) -> None:
    with closing(sqlite3.connect(impatient.path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(DatabaseBusy, match="locked"), impatient.writing():
            pytest.fail("two writers at once")
        assert stored_runs(impatient) == 0
        other.execute("ROLLBACK")
    with impatient.writing() as connection:
        store_run(connection, 0)


def test_a_writer_in_this_process_makes_the_database_busy(impatient: Database) -> None:
    def second() -> None:
        with impatient.writing():
            pytest.fail("two writers at once")

    with ThreadPoolExecutor(1) as pool, impatient.writing() as connection:
        store_run(connection, 0)
        with pytest.raises(DatabaseBusy, match=r"of this process .* 0\.1 s"):
            pool.submit(second).result()
    assert stored_runs(impatient) == 1


def test_two_processes_lose_nothing(tmp_path: Path, journal_mode: str) -> None:
    path = tmp_path / "clutches.db"
    with closing(open_database(f"sqlite:///{path}")) as database, database.writing() as connection:
        clutches.insert(connection, clutch_row())
    with child(WRITER, path, journal_mode, 0, 40) as one, child(WRITER, path, journal_mode, 100, 40) as other:
        for _, _, says in (one, other):
            assert says.readline() == "open\n"
        for _, hears, _ in (one, other):
            print("go", file=hears, flush=True)
        for _, _, says in (one, other):
            assert says.readline() == "done\n"
    with closing(open_database(f"sqlite:///{path}")) as database, database.reading() as connection:
        clutch = clutches.get(connection, CLUTCH)
        assert clutch is not None
        assert clutch.revision == len(runs.in_order(connection, CLUTCH)) == 80
    assert integrity(path) == ["ok"]
