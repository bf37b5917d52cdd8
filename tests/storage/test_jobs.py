"""Jobs: each function against a real database of either kind."""

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest

from storage import clutches, jobs
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.jobs import CANCELLED, FAILED, FINISHED, RUNNING, WAITING, JobRow, NewJob
from tests.storage.samples import clutch_row

AT = "2026-11-02T10:00:0{}+00:00"


def new_job(number: int, clutch_id: str | None = "a") -> NewJob:
    return NewJob(
        job_id=f"j{number}",
        kind="diagnosis",
        clutch_id=clutch_id,
        asked_at=AT.format(0),
        asked_by="local",
        arguments={"number": number},
    )


@pytest.fixture
def stocked(database: Database) -> Database:
    """Clutch `a` has asked for three jobs, then `b` for one."""
    with database.writing() as connection:
        for name in ("a", "b"):
            clutches.insert(connection, clutch_row(name))
        for number, name in enumerate(("a", "a", "a", "b")):
            jobs.insert(connection, new_job(number, name))
    return database


def claimed(database: Database, claimer: str, second: int = 1, lease: float = 60.0) -> JobRow | None:
    with database.writing(of=claimer) as connection:
        return jobs.claim(connection, claimer, ["diagnosis"], lease=lease, at=AT.format(second))


def test_a_clutch_with_many_jobs_does_not_hold_up_another(stocked: Database) -> None:
    order = []
    for second in range(1, 5):
        row = claimed(stocked, "one", second)
        assert row is not None
        order.append(row.job_id)
        with stocked.writing() as connection:
            assert jobs.end(connection, row.job_id, FINISHED, AT.format(second), claimer="one")
    assert order == ["j0", "j3", "j1", "j2"]
    assert claimed(stocked, "one") is None


def test_a_clutch_that_keeps_asking_is_served_in_turn(stocked: Database) -> None:
    """What `b` asks for while `a`'s jobs wait does not come after all of them, nor before each."""
    order = []
    for second in range(1, 6):
        row = claimed(stocked, "one", second)
        assert row is not None
        order.append(row.clutch_id)
        with stocked.writing() as connection:
            jobs.end(connection, row.job_id, FINISHED, AT.format(second), claimer="one")
            jobs.insert(connection, new_job(10 + second, "b"))
    assert order == ["a", "b", "a", "b", "a"]


def test_a_job_is_the_claimer_s_alone_until_it_ends(stocked: Database) -> None:
    row = claimed(stocked, "one")
    assert row is not None
    assert (row.job_id, row.state, row.attempts, row.claimed_by) == ("j0", RUNNING, 1, "one")
    assert row.arguments == {"number": 0}
    with stocked.writing() as connection:
        assert not jobs.renew(connection, "j0", "two", lease=60.0, progress=None)
        assert jobs.renew(connection, "j0", "one", lease=60.0, progress={"step": "reads"})
        assert not jobs.end(connection, "j0", FINISHED, AT.format(2), claimer="two")
        assert jobs.end(connection, "j0", FAILED, AT.format(2), problem="it broke", claimer="one")
        assert not jobs.end(connection, "j0", CANCELLED, AT.format(3))
        ended = jobs.get(connection, "j0")
    assert ended is not None
    assert (ended.state, ended.problem, ended.progress) == (FAILED, "it broke", {"step": "reads"})
    assert ended.finished_at == AT.format(2)


def test_a_job_whose_lease_has_run_out_is_claimed_again(stocked: Database) -> None:
    first = claimed(stocked, "one", lease=-1.0)
    second = claimed(stocked, "two", second=2)
    assert first is not None
    assert second is not None
    assert (second.clutch_id, second.job_id) == ("b", "j3"), "the other clutch was not served yet"
    third = claimed(stocked, "two", second=3)
    assert third is not None
    assert (third.job_id, third.attempts, third.claimed_by) == ("j0", 2, "two")
    with stocked.writing() as connection:
        assert not jobs.renew(connection, "j0", "one", lease=60.0, progress=None)
        assert not jobs.end(connection, "j0", FINISHED, AT.format(4), claimer="one")


def test_a_job_that_is_given_back_was_not_begun(stocked: Database) -> None:
    assert claimed(stocked, "one") is not None
    with stocked.writing() as connection:
        jobs.release(connection, "j0", "two")
        jobs.release(connection, "j0", "one")
        row = jobs.get(connection, "j0")
    assert row is not None
    assert (row.state, row.attempts, row.claimed_by) == (WAITING, 0, None)


def test_what_nobody_holds_any_more_is_free(stocked: Database) -> None:
    for second in range(1, 5):
        assert claimed(stocked, "one", second) is not None
    with stocked.writing() as connection:
        assert not jobs.any_free(connection, ["diagnosis"])
        jobs.release_all(connection)
        assert jobs.any_free(connection, ["diagnosis"])
    again = claimed(stocked, "two")
    assert again is not None
    assert again.attempts == 2


def test_pages_are_newest_first_and_narrowed(stocked: Database) -> None:
    with stocked.writing() as connection:
        jobs.insert(connection, new_job(4, None))
        jobs.end(connection, "j1", CANCELLED, AT.format(1), problem="cancelled")
        first = jobs.page(connection, limit=2)
        rest = jobs.page(connection, limit=9, before=first[-1].job_key)
        assert [row.job_id for row in (*first, *rest)] == ["j4", "j3", "j2", "j1", "j0"]
        assert [row.job_id for row in jobs.page(connection, limit=9, state=CANCELLED)] == ["j1"]
        assert [row.job_id for row in jobs.page(connection, limit=9, only=["b"])] == ["j3"]
        assert jobs.page(connection, limit=9, only=[]) == []
        assert jobs.count_open(connection, "diagnosis") == 4
        assert jobs.count_open(connection, "replay") == 0
        jobs.set_arguments(connection, "j0", {"adopt_by": "local"})
        changed = jobs.get(connection, "j0")
        assert changed is not None
        assert changed.arguments == {"adopt_by": "local"}


def test_processes_that_claim_at_once_get_a_job_each(stocked: Database) -> None:
    together = threading.Barrier(4)

    def claim(name: str) -> str | None:
        with closing(open_database(stocked.url)) as database:
            together.wait()
            row = claimed(database, name)
            while row is None:  # the row that was next was taken meanwhile
                row = claimed(database, name)
            return row.job_id

    with ThreadPoolExecutor(4) as pool:
        got = list(pool.map(claim, ("one", "two", "three", "four")))
    assert sorted(filter(None, got)) == ["j0", "j1", "j2", "j3"]
