"""How the process of a job is started, and which jobs wait for which."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from service.jobs import process
from service.jobs.process import Work
from service.jobs.queue import JobKind, JobQueue, Leases
from service.settings import DATABASE_VARIABLE, Settings
from storage import jobs
from storage.engine.database import Database
from storage.jobs import Hold, JobRow
from tests.service.jobs.waiting import until
from tests.storage.samples import read_from, write_to

ADDRESS = "postgresql+psycopg://u:s3cr3t@host/db"
AT = "2026-11-02T10:00:00+00:00"
JOB = ("tests.service.jobs.job_process",)
SLEEPS = Work(modules=JOB, task={"how": "sleeps"}, longest=60.0)


class StartedError(Exception):
    """In place of a process."""


@pytest.mark.usefixtures("own_processes")
def test_no_argument_shows_the_address_of_the_database(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other users of the machine see the arguments of a process, but not its environment."""
    started: dict[str, Any] = {}

    def start(command: list[str], **options: Any) -> None:
        started.update(options, command=command)
        raise StartedError

    monkeypatch.setattr(process.subprocess, "Popen", start)
    with pytest.raises(StartedError), process.running(SLEEPS, ADDRESS):
        pytest.fail("it was not started")
    assert "s3cr3t" not in " ".join(started["command"])
    assert started["env"][DATABASE_VARIABLE] == ADDRESS


def ask(database: Database, job_id: str, kind: str) -> None:
    arguments = {"request": ""}
    new = JobRow(job_id=job_id, kind=kind, clutch_id=None, asked_at=AT, asked_by="local", arguments=arguments)
    write_to(database, jobs.insert, new)


def states(database: Database) -> dict[str, str]:
    return {row.job_id: row.state for row in read_from(database, jobs.page, limit=9)}


def finish_of(database: Database) -> Callable[[JobRow, Mapping[str, Any]], None]:
    """What stores a job's end and no more."""

    def finish(job: JobRow, ended: Mapping[str, Any]) -> None:
        problem = ended.get("problem")
        state = jobs.FINISHED if problem is None else jobs.FAILED
        write_to(database, jobs.end, job.job_id, state, AT, problem=problem, claimer=job.claimed_by)

    return finish


@contextmanager
def started(database: Database, *groups: Mapping[str, JobKind], lease: int = 1) -> Iterator[JobQueue]:
    queue = JobQueue(database, Settings(job_lease_seconds=lease), groups)
    queue.start()
    try:
        yield queue
    finally:
        queue.close()


@pytest.mark.usefixtures("own_processes")
def test_of_a_group_one_is_done_at_a_time_and_other_groups_do_not_wait(
    in_file: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A diagnosis is made while a replay of the whole fleet runs; a fleet refresh waits for its end."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))

    endless = JobKind(lambda _job, _settings: SLEEPS, finish_of(in_file))
    quick = JobKind(lambda _job, _settings: Work(modules=("this",), task={}, longest=0.0), finish_of(in_file))
    for job_id, kind in (("r", jobs.REPLAY), ("f", jobs.FLEET_REFRESH), ("d", jobs.DIAGNOSIS), ("other", "unheard of")):
        ask(in_file, job_id, kind)
    groups = {jobs.DIAGNOSIS: quick}, {jobs.REPLAY: endless, jobs.FLEET_REFRESH: endless}
    with started(in_file, *groups) as queue:
        until(lambda: states(in_file) == {"r": "running", "f": "waiting", "d": "failed", "other": "waiting"})
        assert queue.is_working()
        assert write_to(in_file, jobs.end, "r", jobs.CANCELLED, AT)
        until(lambda: states(in_file) == {"r": "cancelled", "f": "running", "d": "failed", "other": "waiting"})
    assert not queue.is_working()
    assert states(in_file) == {"r": "cancelled", "f": "waiting", "d": "failed", "other": "waiting"}, "given back"


def test_a_queue_that_is_woken_looks_at_once(in_file: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has looked before there was anything to do, and would look again after six minutes."""

    def work(_: JobRow, __: Settings) -> Work:
        raise StartedError

    any_free, looked = jobs.any_free, threading.Event()

    def watched(*arguments: Any) -> bool:
        free = any_free(*arguments)
        looked.set()
        return free

    monkeypatch.setattr(jobs, "any_free", watched)
    with started(in_file, {jobs.REPLAY: JobKind(work, finish_of(in_file))}, lease=3600) as queue:
        assert looked.wait(60.0)
        ask(in_file, "r", jobs.REPLAY)
        queue.wake()
        until(lambda: states(in_file) == {"r": "failed"})


def test_a_lease_ends_by_a_clock_that_nobody_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ended by the wall clock: set forward, whoever worked lost the job; set back, it was held for as long."""
    now = [100.0]
    monkeypatch.setattr("service.jobs.queue.time", SimpleNamespace(monotonic=lambda: now[0]))
    leases, left, renewed = Leases(30.0), Hold("left", 1), [Hold("held", number) for number in range(9)]
    for number in range(6):
        assert leases.ended([left, renewed[number]]) == []
        now[0] += 5.0
    assert leases.ended([left, renewed[6]]) == [left]
    assert leases.ended([]) == []
    assert leases.ended([left]) == [], "it was not there in between"


def test_a_job_whose_process_does_not_renew_it_is_done_by_who_sees_that(in_file: Database) -> None:
    """And one that is renewed is left alone, though both were claimed long ago by any clock."""
    done = JobKind(lambda _job, _settings: Work(modules=("this",), task={}, longest=0.0), finish_of(in_file))
    with started(in_file, {jobs.REPLAY: done}):
        with in_file.writing(of="another") as connection:
            for name in ("left", "held"):
                new = JobRow(
                    job_id=name, kind=jobs.REPLAY, clutch_id=None, asked_at=AT, asked_by="a", arguments={"request": ""}
                )
                jobs.insert(connection, new)
                assert jobs.claim(connection, "another", [jobs.REPLAY], at="1970-01-01T00:00:00+00:00")

        def look() -> bool:
            assert write_to(in_file, jobs.renew, "held", "another", progress=None)
            return states(in_file)["left"] == "failed"

        until(look)
        assert states(in_file)["held"] == "running"


RARE = [pytest.param(how, marks=pytest.mark.slow) for how in ("raises", "writes garbage", "says nothing")]


@pytest.mark.parametrize("how", ["dies", "writes a list", "cannot start", "cannot be stored", "cannot end", *RARE])
def test_a_job_that_fails_in_any_way_is_marked_failed_and_the_next_one_runs(
    in_file: Database, caplog: pytest.LogCaptureFixture, how: str
) -> None:
    def finish(job: JobRow, ended: Mapping[str, Any]) -> None:
        if job.job_id == "bad" and (how == "cannot end" or (how == "cannot be stored" and "problem" not in ended)):
            raise KeyError("adopt_by")
        finish_of(in_file)(job, ended)

    def work(job: JobRow, _: Settings) -> Work:
        if job.job_id == "bad" and how == "cannot start":
            raise OSError("no process can be started")
        task = {"how": how if job.job_id == "bad" else "ends well"}
        return Work(modules=JOB, task=task, longest=60.0)

    ask(in_file, "bad", jobs.REPLAY)
    ask(in_file, "next", jobs.REPLAY)
    with started(in_file, {jobs.REPLAY: JobKind(work, finish)}) as queue:
        until(lambda: states(in_file) == {"bad": "failed", "next": "finished"})
        assert queue.is_working()
    row = read_from(in_file, jobs.get, "bad")
    assert row.problem
    if how == "dies":
        assert "stopped (SIGKILL)" in row.problem, "it wrote nothing: the log has nothing of it"
    else:
        assert any(record.levelname == "ERROR" for record in caplog.records), "it is logged"
