"""The two locks beside a file: of its writers, and of its service."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches
from storage.engine.errors import DatabaseBusy, ServiceRuns, StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.sqlite.connect import WriteLock, service_lock
from tests.storage.samples import OLD, child, integrity, old_database, revision

# --- The lock beside the file: one writer among all threads and processes, and commits that pass readers by.

IN_TIME = 60.0
_SPAWN = multiprocessing.get_context("spawn")


def _hold(path: str, say: "multiprocessing.connection.Connection") -> None:
    with WriteLock(Path(path), IN_TIME).held():
        say.send("held")
        say.recv()


def _count(lock: WriteLock, counter: Path) -> None:
    """Read, wait a moment and write a number, sixty times: two at once would lose steps."""
    for _ in range(60):
        with lock.held():
            number = int(counter.read_text())
            time.sleep(0.0005)
            counter.write_text(str(number + 1))


def _count_elsewhere(path: Path, counter: Path) -> None:
    _count(WriteLock(path, IN_TIME), counter)


def test_processes_and_threads_take_it_one_at_a_time(tmp_path: Path) -> None:
    path, counter = tmp_path / "a.db", tmp_path / "counter"
    counter.write_text("0")
    others = [_SPAWN.Process(target=_count_elsewhere, args=(path, counter)) for _ in range(2)]
    for other in others:
        other.start()
    lock = WriteLock(path, IN_TIME)
    with ThreadPoolExecutor(2) as pool:
        for done in [pool.submit(_count, lock, counter) for _ in range(2)]:
            done.result(IN_TIME)
    for other in others:
        other.join(IN_TIME)
        assert other.exitcode == 0
    assert counter.read_text() == "240"


def test_who_does_not_get_it_in_time_is_told_and_a_kill_frees_it(tmp_path: Path) -> None:
    ours, theirs = multiprocessing.Pipe()
    other = _SPAWN.Process(target=_hold, args=(str(tmp_path / "a.db"), theirs))
    other.start()
    assert ours.poll(IN_TIME)
    assert ours.recv() == "held"
    impatient = WriteLock(tmp_path / "a.db", 0.05)
    with pytest.raises(DatabaseBusy, match="another process"), impatient.held():
        pytest.fail("two writers at once")
    os.kill(other.pid, signal.SIGKILL)
    other.join(IN_TIME)
    with impatient.held(), ThreadPoolExecutor(1) as pool, pytest.raises(DatabaseBusy, match="another request"):
        pool.submit(impatient.held().__enter__).result(IN_TIME)


def test_where_no_lock_can_be_made_nothing_is_written_and_no_service_starts(tmp_path: Path) -> None:
    path = tmp_path / "nowhere" / "a.db"
    for lock, says in ((WriteLock(path, 0.05).held(), "lock"), (service_lock(path), "lock of the database")):
        with pytest.raises(StorageUnavailable, match=says), lock:
            pytest.fail("without the lock")


def test_an_exception_inside_frees_it(tmp_path: Path) -> None:
    lock = WriteLock(tmp_path / "a.db", 0.05)
    with pytest.raises(RuntimeError, match="inside"), lock.held():
        raise RuntimeError("inside")
    with lock.held():
        pass
    lock.close()
    with lock.held():  # a file that was closed is opened again
        pass


def test_a_file_that_is_up_to_date_is_opened_while_another_writes(tmp_path: Path) -> None:
    url, lock = f"sqlite:///{tmp_path / 'a.db'}", WriteLock(tmp_path / "a.db", IN_TIME)
    with lock.held(), pytest.raises(DatabaseBusy):  # a file that is to be made waits
        open_database(url, lock_timeout=0.05)
    open_database(url).close()
    with lock.held(), closing(open_database(url, lock_timeout=0.05)) as database, database.reading() as connection:
        assert database.journal_mode == "wal"
        assert clutches.all_ids(connection) == []
    with closing(sqlite3.connect(tmp_path / "a.db")) as old, old:
        old.execute("UPDATE alembic_version SET version_num = 'earlier'")
    with lock.held(), pytest.raises(DatabaseBusy):  # a file whose revision differs waits, to be migrated or refused
        open_database(url, lock_timeout=0.05)


# --- One service of a database at a time: a second one is refused, and a dead one is in nobody's way.

HOLDER = """
import sys, time
from pathlib import Path
from storage.engine.sqlite.connect import service_lock
with service_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(600)
"""


def test_a_second_service_is_refused_until_the_first_has_ended_however_it_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with child(HOLDER, path) as (holder, _, says):
        assert says.readline() == "held\n"
        with (
            pytest.raises(ServiceRuns, match=rf"a\.db: a service uses .* \(process {holder.pid}\)"),
            service_lock(path),
        ):
            pass
        os.kill(holder.pid, signal.SIGKILL)
        holder.wait()
        for _ in range(2):
            with service_lock(path):
                pass


@pytest.mark.usefixtures("later_step")
def test_a_file_is_not_migrated_under_a_running_service(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    with service_lock(path):
        with pytest.raises(ServiceRuns):
            open_database(f"sqlite:///{path}")
        assert revision(path) == OLD
        with closing(open_database(f"sqlite:///{path}", serving=True)) as own:  # the service itself
            assert not own.faults(least_free=0)
            open_database(f"sqlite:///{path}").close()  # a command beside it: nothing is left to migrate
    assert integrity(path) == ["ok"]
