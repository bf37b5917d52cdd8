"""Jobs in either kind of database: whose turn it is, and whose a job is."""

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from sqlalchemy import Connection

from storage import clutches, jobs
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.jobs import CANCELLED, FAILED, FINISHED, RUNNING, WAITING, Hold, JobRow
from tests.storage.samples import CLUTCH, clutch_row

AT = "2026-11-02T10:00:0{}+00:00"


def new_job(number: int, clutch_id: str | None = CLUTCH) -> JobRow:
    return JobRow(
        job_id=f"j{number}",
        kind="diagnosis",
        clutch_id=clutch_id,
        asked_at=AT.format(0),
        asked_by="local",
        arguments={"number": number},
    )


def ask(connection: Connection) -> None:
    """A clutch asks for three jobs, then the other for one."""
    for number, name in enumerate((CLUTCH, CLUTCH, CLUTCH, "other")):
        jobs.insert(connection, new_job(number, name))


@pytest.fixture
def connection(connection: Connection) -> Connection:
    ask(connection)
    return connection


def claimed(connection: Connection, claimer: str, second: int = 1, abandoned: Sequence[Hold] = ()) -> JobRow:
    return jobs.claim(connection, claimer, ["diagnosis"], at=AT.format(second), abandoned=abandoned)


def test_a_clutch_with_many_jobs_does_not_hold_up_another(connection: Connection) -> None:
    order = []
    for second in range(1, 5):
        row = claimed(connection, "one", second)
        order.append(row.job_id)
        assert jobs.end(connection, row.job_id, FINISHED, AT.format(second), claimer="one")
    assert order == ["j0", "j3", "j1", "j2"]
    assert jobs.claim(connection, "one", ["diagnosis"], at=AT.format(1)) is None


def test_a_clutch_that_keeps_asking_is_served_in_turn(connection: Connection) -> None:
    """What the other asks for while the first one's jobs wait does not come after all of them, nor before each."""
    order = []
    for second in range(1, 6):
        row = claimed(connection, "one", second)
        order.append(row.clutch_id)
        jobs.end(connection, row.job_id, FINISHED, AT.format(second), claimer="one")
        jobs.insert(connection, new_job(10 + second, "other"))
    assert order == [CLUTCH, "other", CLUTCH, "other", CLUTCH]


def test_a_job_is_the_claimer_s_alone_until_it_ends(connection: Connection) -> None:
    row = claimed(connection, "one")
    assert (row.job_id, row.state, row.attempts, row.claimed_by) == ("j0", RUNNING, 1, "one")
    assert row.arguments == {"number": 0}
    assert not jobs.renew(connection, "j0", "two", progress=None)
    assert jobs.renew(connection, "j0", "one", progress={"step": "reads"})
    assert not jobs.end(connection, "j0", FINISHED, AT.format(2), claimer="two")
    assert jobs.end(connection, "j0", FAILED, AT.format(2), problem="it broke", claimer="one")
    assert not jobs.end(connection, "j0", CANCELLED, AT.format(3))
    ended = jobs.get(connection, "j0")
    assert (ended.state, ended.problem, ended.progress) == (FAILED, "it broke", {"step": "reads"})
    assert ended.finished_at == AT.format(2)


def test_a_job_that_was_not_renewed_is_claimed_again(connection: Connection) -> None:
    claimed(connection, "one")
    (left,) = before = jobs.holds(connection, ["diagnosis"])
    assert left.job_id == "j0"
    second = claimed(connection, "two", 2, before)
    assert (second.clutch_id, second.job_id) == ("other", "j3"), "the other clutch was not served yet"
    for name in ("j1", "j2"):
        jobs.end(connection, name, CANCELLED, AT.format(2))
    assert jobs.renew(connection, "j0", "one", progress=None)
    assert not jobs.any_free(connection, ["diagnosis"], before)
    assert claimed(connection, "two", 3, before) is None, "its process is there"
    assert jobs.holds(connection, ["replay"]) == []
    third = claimed(connection, "two", 3, jobs.holds(connection, ["diagnosis"])[:1])
    assert (third.job_id, third.attempts, third.claimed_by) == ("j0", 2, "two")
    assert not jobs.renew(connection, "j0", "one", progress=None)
    assert not jobs.end(connection, "j0", FINISHED, AT.format(4), claimer="one")


def test_a_job_that_is_given_back_was_not_begun_and_what_nobody_holds_any_more_is_free(connection: Connection) -> None:
    claimed(connection, "one")
    jobs.release(connection, "j0", "two")
    jobs.release(connection, "j0", "one")
    row = jobs.get(connection, "j0")
    assert (row.state, row.attempts, row.claimed_by) == (WAITING, 0, None)
    for second in range(1, 5):
        claimed(connection, "one", second)
    assert not jobs.any_free(connection, ["diagnosis"])
    jobs.release_all(connection)
    assert jobs.any_free(connection, ["diagnosis"])
    assert claimed(connection, "two").attempts == 2


def test_pages_are_newest_first_and_narrowed(connection: Connection) -> None:
    jobs.insert(connection, new_job(4, None))
    jobs.end(connection, "j1", CANCELLED, AT.format(1), problem="cancelled")
    first = jobs.page(connection, limit=2)
    rest = jobs.page(connection, limit=9, before=first[-1].job_key)
    assert [row.job_id for row in (*first, *rest)] == ["j4", "j3", "j2", "j1", "j0"]
    assert [row.job_id for row in jobs.page(connection, limit=9, state=CANCELLED)] == ["j1"]
    assert [row.job_id for row in jobs.page(connection, limit=9, only=["other"])] == ["j3"]
    assert jobs.page(connection, limit=9, only=[]) == []
    assert jobs.count_open(connection, "diagnosis") == 4
    assert jobs.count_open(connection, "replay") == 0
    jobs.set_arguments(connection, "j0", {"adopt_by": "local"})
    changed = jobs.get(connection, "j0")
    assert changed.arguments == {"adopt_by": "local"}


def test_processes_that_claim_at_once_get_a_job_each(database: Database) -> None:
    with database.writing() as connection:
        for name in (CLUTCH, "other"):
            clutches.insert(connection, clutch_row(name))
        ask(connection)
    together = threading.Barrier(4)

    def claim(name: str) -> str:
        with closing(open_database(database.url)) as own:
            together.wait()
            while True:
                with own.writing(of=name) as connection:
                    row = jobs.claim(connection, name, ["diagnosis"], at=AT.format(1))
                if row is not None:  # else the row that was next was taken meanwhile
                    return row.job_id

    with ThreadPoolExecutor(4) as pool:
        got = list(pool.map(claim, ("one", "two", "three", "four")))
    assert sorted(got) == ["j0", "j1", "j2", "j3"]
