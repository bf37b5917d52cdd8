"""Writers queue, readers see one state, and what fails leaves nothing behind."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches, runs
from storage.engine.database import Database
from storage.engine.errors import DatabaseBusy
from storage.engine.opening import open_database
from tests.storage.samples import clutch_row, integrity, store_run

CLUTCH = "bench3-017"


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
