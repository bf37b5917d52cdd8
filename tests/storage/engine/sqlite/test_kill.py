"""A writer that is killed leaves the database as it was after its last commit, and usable at once."""

import os
import random
import signal
import time
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches, raw_columns, runs
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.storage.samples import CLUTCH, child, clutch_row, columns, integrity, store_run, write_to
from tests.support import one_quick

#: Kills itself at a named moment of the second run's transaction.
SUICIDE = """
import os, signal, sys
import storage.engine.sqlite.connect
import storage.engine.opening
from storage import clutches, raw_columns, runs
from tests.storage.samples import columns, new_run
path, mode, moment, length = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
storage.engine.sqlite.connect.JOURNAL_MODE = mode
database = storage.engine.opening.open_database(f"sqlite:///{path}")
def reached(name):
    if name == moment:
        os.kill(os.getpid(), signal.SIGKILL)
with database.writing() as connection:
    reached("begun")
    key = runs.insert(connection, new_run(1))
    reached("run inserted")
    raw_columns.write(connection, key, raw_columns.encoded(columns(1, length)))
    reached("channels written")
    clutches.bump_revision(connection, "bench3-017")
    if mode == "delete":  # what a rollback journal must undo: pages that have reached the file already
        connection.exec_driver_sql("PRAGMA cache_spill=ON")
        connection.exec_driver_sql("PRAGMA cache_size=2")
        raw_columns.values_of(raw_columns.stored_of_run(connection, key))
        connection.exec_driver_sql("UPDATE channel SET data = zeroblob(200000)")
    reached("all written")
"""

#: Commits run after run and says so, until it is killed.
BUSY = """
import sys
import storage.engine.sqlite.connect
import storage.engine.opening
from tests.storage.samples import store_run
path, mode = sys.argv[1], sys.argv[2]
storage.engine.sqlite.connect.JOURNAL_MODE = mode
database = storage.engine.opening.open_database(f"sqlite:///{path}")
for number in range(1, 100_000):
    with database.writing() as connection:
        store_run(connection, number, length=2000)
    print(number, flush=True)
"""


@pytest.fixture
def path(tmp_path: Path, journal_mode: str) -> Path:
    del journal_mode
    with closing(open_database(f"sqlite:///{tmp_path}/clutches.db")) as database, database.writing() as connection:
        clutches.insert(connection, clutch_row())
        store_run(connection, 0)
    return tmp_path / "clutches.db"


def assert_whole(database: Database) -> int:
    """Every stored run has its channels bit for bit and was counted in the revision. Returns the number of runs."""
    with database.reading() as connection:
        rows = runs.in_order(connection, CLUTCH)
        assert [row.run_id for row in rows] == [f"run-{number:04d}" for number in range(len(rows))]
        for number, row in enumerate(rows):
            stored = raw_columns.values_of(raw_columns.stored_of_run(connection, row.run_key))
            expected = columns(number, stored["torque_nm"].size)
            assert {name: each.tobytes() for name, each in stored.items()} == {
                name: each.tobytes() for name, each in expected.items()
            }
        clutch = clutches.get(connection, CLUTCH)
        assert clutch.revision == len(rows)
    return len(rows)


@pytest.mark.parametrize(
    ("moment", "length"),
    one_quick([("all written", 300_000), ("begun", 40), ("run inserted", 40), ("channels written", 300_000)]),
)
def test_killed_in_mid_transaction(path: Path, journal_mode: str, moment: str, length: int) -> None:
    with child(SUICIDE, path, journal_mode, moment, length) as (writer, _, _):
        assert writer.wait(timeout=60) == -signal.SIGKILL
    with closing(open_database(f"sqlite:///{path}", lock_timeout=1.0)) as database:
        assert assert_whole(database) == 1
        write_to(database, store_run, 1)
        assert assert_whole(database) == 2
    assert integrity(path) == ["ok"]


@pytest.mark.parametrize("seed", one_quick([1, 2, 3]))
def test_killed_at_any_moment_what_was_committed_stays(path: Path, journal_mode: str, seed: int) -> None:
    with child(BUSY, path, journal_mode) as (writer, _, says):
        for number in range(1, 6):
            assert says.readline() == f"{number}\n"
        time.sleep(random.Random(seed).uniform(0.0, 0.03))  # noqa: S311 - a moment, not a secret
        os.kill(writer.pid, signal.SIGKILL)
        committed = max([5, *map(int, says)]) + 1  # and the run that was there before
    with closing(open_database(f"sqlite:///{path}", lock_timeout=1.0)) as database:
        stored = assert_whole(database)
        assert stored in {committed, committed + 1}  # killed between the commit and the word
        write_to(database, store_run, stored)
        assert assert_whole(database) == stored + 1
    assert integrity(path) == ["ok"]
