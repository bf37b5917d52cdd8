"""Writers queue, readers see one state, and what fails leaves nothing behind."""

import contextlib
import sqlite3
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from storage import channels, clutches, runs
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


def test_a_failed_statement_rolls_back_what_came_before(impatient: Database) -> None:
    def fail() -> None:
        with impatient.writing() as connection:
            store_run(connection, 0)
            clutches.bump_revision(connection, "nobody")

    with pytest.raises(LookupError):
        fail()
    with impatient.reading() as connection:
        assert len(runs.in_order(connection, CLUTCH)) == 0
        assert clutches.get(connection, CLUTCH) == clutch_row()


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


def test_threads_take_turns_and_readers_never_see_half_a_run(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
    done = threading.Event()

    def write(first: int) -> None:
        for number in range(first, first + 25):
            with database.writing() as connection:
                store_run(connection, number)

    def read() -> int:
        looks = 0
        while not done.is_set():
            with database.reading() as connection:
                clutch = clutches.get(connection, CLUTCH)
                assert clutch is not None
                keys = [row.run_key for row in runs.in_order(connection, CLUTCH)]
                assert clutch.revision == len(keys)
                assert all(len(channels.read(connection, key)) == 3 for key in keys[-3:])
            looks += 1
            time.sleep(0.002)
        return looks

    with ThreadPoolExecutor(6) as pool:
        readers = [pool.submit(read) for _ in range(2)]
        writers = [pool.submit(write, first) for first in (0, 100, 200, 300)]
        try:
            for each in writers:
                each.result()
        finally:
            done.set()
        assert all(each.result() > 0 for each in readers)
    assert stored_runs(database) == 100


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


def test_the_version_changes_with_every_commit_and_with_nothing_else(database: Database) -> None:
    numbers = [database.watch.version(), database.watch.version()]
    with database.writing() as connection:
        connection.exec_driver_sql("CREATE TABLE extra (x)")
        numbers.append(database.watch.version())  # not committed yet
    assert len(set(numbers)) == 1
    numbers.append(database.watch.version())
    with contextlib.suppress(RuntimeError), database.writing() as connection:
        connection.exec_driver_sql("INSERT INTO extra VALUES (1)")
        raise RuntimeError
    assert database.watch.version() == numbers[-1] != numbers[0]
    with database.reading() as connection:
        connection.exec_driver_sql("SELECT * FROM extra").fetchall()
    assert database.watch.version() == numbers[-1]
    other = open_database(f"sqlite:///{database.path}")
    with other.writing() as connection:
        connection.exec_driver_sql("INSERT INTO extra VALUES (2)")
    assert database.watch.version() not in numbers
    other.close()
