"""On both kinds of database writers queue, readers see one state, and what fails leaves nothing behind."""

import contextlib
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from storage import clutches, raw_columns, runs
from storage.engine.database import Database
from storage.engine.errors import DatabaseBusy, StorageUnavailable
from storage.engine.opening import open_database
from tests.storage.samples import CLUTCH, clutch_row, read_from, store_run, write_to


@pytest.fixture
def database(database: Database) -> Database:
    """One with a clutch."""
    write_to(database, clutches.insert, clutch_row())
    return database


def test_a_failed_statement_rolls_back_what_came_before(database: Database) -> None:
    def fail() -> None:
        with database.writing() as connection:
            store_run(connection, 0)
            clutches.bump_revision(connection, "nobody")

    with pytest.raises(LookupError):
        fail()
    with database.reading() as connection:
        assert len(runs.in_order(connection, CLUTCH)) == 0
        assert clutches.get(connection, CLUTCH) == clutch_row()


def test_an_error_in_the_middle_of_a_result_leaves_no_later_transaction_in_the_past(database: Database) -> None:
    """What holds the error held the rest of the result, and with it the state of the database that the connection read."""
    write_to(database, clutches.insert, clutch_row("another"))

    def fail() -> None:
        with database.reading() as connection:
            rows = connection.exec_driver_sql("SELECT clutch_id FROM clutch")
            raise LookupError(rows.fetchone())

    with pytest.raises(LookupError) as held:
        fail()
    write_to(database, clutches.bump_revision, CLUTCH)
    assert read_from(database, clutches.revisions)[CLUTCH] == 1
    assert held.value is not None


def test_threads_take_turns_and_readers_never_see_half_a_run(database: Database) -> None:
    done = threading.Event()

    def write(first: int) -> None:
        for number in range(first, first + 25):
            write_to(database, store_run, number)

    def read() -> int:
        looks = 0
        while not done.is_set():
            with database.reading() as connection:
                clutch = clutches.get(connection, CLUTCH)
                keys = [row.run_key for row in runs.in_order(connection, CLUTCH)]
                assert clutch.revision == len(keys)
                assert all(
                    len(raw_columns.values_of(raw_columns.stored_of_run(connection, key))) == 3 for key in keys[-3:]
                )
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
    assert len(read_from(database, runs.in_order, CLUTCH)) == 100


def test_the_version_changes_with_every_commit_and_with_nothing_else(database: Database) -> None:
    numbers = [database.watch.snapshot().version, database.watch.snapshot().version]
    with database.writing() as connection:
        connection.exec_driver_sql("CREATE TABLE extra (x INTEGER)")
        numbers.append(database.watch.snapshot().version)  # not committed yet
    assert len(set(numbers)) == 1
    numbers.append(database.watch.snapshot().version)
    with contextlib.suppress(RuntimeError), database.writing() as connection:
        connection.exec_driver_sql("INSERT INTO extra VALUES (1)")
        raise RuntimeError
    assert database.watch.snapshot().version == numbers[-1] != numbers[0]
    with database.reading() as connection:
        connection.exec_driver_sql("SELECT * FROM extra").fetchall()
    assert database.watch.snapshot().version == numbers[-1]
    other = open_database(database.url)
    with other.writing() as connection:
        connection.exec_driver_sql("INSERT INTO extra VALUES (2)")
    assert database.watch.snapshot().version not in numbers
    other.close()


def test_a_reader_keeps_the_state_of_its_first_statement(database: Database) -> None:
    with database.reading() as reader:
        assert runs.in_order(reader, CLUTCH) == []
        with database.writing() as connection:
            store_run(connection, 0)
            assert len(runs.in_order(connection, CLUTCH)) == 1
        assert runs.in_order(reader, CLUTCH) == []
        assert clutches.revision(reader, CLUTCH) == 0
    with database.reading() as reader:
        assert (len(runs.in_order(reader, CLUTCH)), clutches.revision(reader, CLUTCH)) == (1, 1)


def test_a_second_writer_gives_up_in_time(database: Database) -> None:
    with contextlib.closing(open_database(database.url, lock_timeout=0.1)) as impatient:
        with database.writing() as connection:
            store_run(connection, 0)
            with pytest.raises(DatabaseBusy), impatient.writing():
                pytest.fail("two writers at once")
        assert len(write_to(impatient, runs.in_order, CLUTCH)) == 1


def test_a_closed_database_says_so(database: Database) -> None:
    database.close()
    database.close()
    for block in (database.reading, database.writing):
        with pytest.raises(StorageUnavailable, match="has been closed"), block():
            pytest.fail("it was closed")
    assert database.faults(least_free=0) == {"database": "it has been closed"}
