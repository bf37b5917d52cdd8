"""The table of jobs: waiting, running, finished, failed or cancelled. Lists begin with the newest.

A job is claimed by a process, which holds it for a while and prolongs that while it works (a lease). A job whose lease has
run out may be claimed again: its process was killed. On PostgreSQL rows that another claim has just locked are passed over;
on SQLite one process writes at a time anyway.
"""

from collections.abc import Collection
from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, Double, Text, and_, bindparam, func, or_, select, update

from storage.dialects import among, now_in_seconds
from storage.encoding import Json, Rows, to_text
from storage.tables import OPEN_ONLY, job

WAITING, RUNNING, FINISHED, FAILED, CANCELLED = "waiting", "running", "finished", "failed", "cancelled"
#: The states of a job that has not ended.
OPEN = (WAITING, RUNNING)
#: The kinds of job that there are.
DIAGNOSIS, REPLAY, FLEET_REFRESH = "diagnosis", "replay", "fleet_refresh"


@dataclass(frozen=True, slots=True, kw_only=True)
class NewJob:
    """A job as it is asked for: `clutch_id` None where it is of no single clutch, `arguments` what its kind needs."""

    job_id: str
    kind: str
    clutch_id: str | None
    asked_at: str
    asked_by: str
    arguments: Json


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRow(NewJob):
    """A stored job; the later it was asked for, the greater its key. `attempts` counts how often it was begun."""

    job_key: int
    state: str
    attempts: int
    claimed_by: str | None
    started_at: str | None
    finished_at: str | None
    progress: Json | None
    problem: str | None

    @property
    def of(self) -> str | None:
        """What the job is of: a clutch, or the key of a kind of clutches; None: of all."""
        return self.clutch_id or self.arguments.get("fleet")


_new, _rows = Rows(NewJob), Rows(JobRow)
_insert = sa.insert(job)
_wanted = job.c.job_id == bindparam("wanted")
_by_id = select(job).where(_wanted)
_newest = (
    select(job)
    .where(
        job.c.job_key < bindparam("before", type_=Double),
        or_(bindparam("in_state", type_=Text).is_(None), job.c.state == bindparam("in_state")),
    )
    .order_by(job.c.job_key.desc())
    .limit(bindparam("most"))
)
_open = select(job).where(OPEN_ONLY, job.c.kind == bindparam("of_kind")).order_by(job.c.job_key)
_count = select(func.count()).select_from(job).where(OPEN_ONLY, job.c.kind == bindparam("of_kind"))
_free = and_(
    OPEN_ONLY, among(job.c.kind, "of_kinds"), or_(job.c.state == WAITING, job.c.leased_until < now_in_seconds())
)
_any_free = select(sa.exists(select(job.c.job_key).where(_free)))
#: The clutch that was served longest ago comes first, then the job that was asked for first: however many of its jobs wait,
#: a clutch holds up another's by one. Jobs of no clutch come before all.
_of_same = job.alias("of_same")
_served = select(func.max(_of_same.c.started_at)).where(_of_same.c.clutch_id == job.c.clutch_id).scalar_subquery()
_next = (
    select(job.c.job_id)
    .where(_free)
    .order_by(_served.asc().nulls_first(), job.c.job_key)
    .limit(1)
    .with_for_update(skip_locked=True, of=job)
)
_leased = now_in_seconds() + bindparam("lease", type_=Double)
_set = update(job).where(_wanted)
_claim = _set.values(state=RUNNING, attempts=job.c.attempts + 1, leased_until=_leased, progress=None)
_claimed = and_(_wanted, job.c.state == RUNNING, job.c.claimed_by == bindparam("claimer"))
_renew = update(job).where(_claimed).values(leased_until=_leased)
_release = (
    update(job).where(_claimed).values(state=WAITING, attempts=job.c.attempts - 1, claimed_by=None, leased_until=None)
)
_release_all = update(job).where(job.c.state == RUNNING).values(leased_until=0.0)
_progress = func.coalesce(bindparam("new_progress", type_=Text), job.c.progress)
_end_claimed, _end_open = (
    update(job).where(these).values(progress=_progress, leased_until=None) for these in (_claimed, _wanted & OPEN_ONLY)
)


def insert(connection: Connection, row: NewJob) -> None:
    """Store a job that waits. Raises IntegrityError where its clutch is unknown or its id taken."""
    connection.execute(_insert, _new.values(row, state=WAITING, attempts=0))


def get(connection: Connection, job_id: str) -> JobRow | None:
    return _rows.first(connection.execute(_by_id, {"wanted": job_id}))


def page(
    connection: Connection,
    *,
    limit: int,
    before: float | None = None,
    state: str | None = None,
    only: Collection[str] | None = None,
) -> list[JobRow]:
    """At most `limit` jobs, newest first, in that state, of `only` these clutches; `before` is the key of the last job
    of the page before."""
    values: dict[str, object] = {"most": limit, "before": 2.0**62 if before is None else before, "in_state": state}
    query = _newest
    if only is not None:
        query, values = (
            query.where(among(job.c.clutch_id, "of_clutches")),
            values | {"of_clutches": to_text(list(only))},
        )
    return _rows.all(connection.execute(query, values))


def count_open(connection: Connection, kind: str) -> int:
    return connection.execute(_count, {"of_kind": kind}).scalar_one()


def open_of(connection: Connection, kind: str) -> list[JobRow]:
    """The jobs of a kind that wait or run, in the order in which they were asked for."""
    return _rows.all(connection.execute(_open, {"of_kind": kind}))


def any_free(connection: Connection, kinds: Collection[str]) -> bool:
    return bool(connection.execute(_any_free, {"of_kinds": to_text(list(kinds))}).scalar_one())


def claim(connection: Connection, claimer: str, kinds: Collection[str], *, lease: float, at: str) -> JobRow | None:
    """The job of these kinds whose turn it is, the claimer's for `lease` [s] from now on; None where none is free."""
    job_id: str | None = connection.execute(_next, {"of_kinds": to_text(list(kinds))}).scalar()
    if job_id is None:
        return None
    connection.execute(_claim, {"wanted": job_id, "claimed_by": claimer, "lease": lease, "started_at": at})
    return get(connection, job_id)


def renew(connection: Connection, job_id: str, claimer: str, *, lease: float, progress: Json | None) -> bool:
    """Hold the job for `lease` [s] more; False where it is no longer the claimer's: cancelled, or claimed by another."""
    claim = {"wanted": job_id, "claimer": claimer, "lease": lease}
    return connection.execute(_renew, claim | _rows.columns(progress=progress)).rowcount == 1


def release(connection: Connection, job_id: str, claimer: str) -> None:
    """Give the claimer's job back; that it was begun does not count."""
    connection.execute(_release, {"wanted": job_id, "claimer": claimer})


def release_all(connection: Connection) -> None:
    """Let all leases end: no process runs that could hold one."""
    connection.execute(_release_all)


def set_arguments(connection: Connection, job_id: str, arguments: Json) -> None:
    connection.execute(_set, {"wanted": job_id, "arguments": to_text(arguments)})


def end(
    connection: Connection,
    job_id: str,
    state: str,
    at: str,
    *,
    problem: str | None = None,
    claimer: str | None = None,
    progress: Json | None = None,
) -> bool:
    """Store how a job ended; False where it has ended already or, where a `claimer` is named, is not its.

    `progress` None: how far it had come stays as it is stored.
    """
    ended = {"wanted": job_id, "state": state, "finished_at": at, "problem": problem}
    values = ended | {"new_progress": _rows.columns(progress=progress)["progress"]}
    if claimer is not None:
        return connection.execute(_end_claimed, values | {"claimer": claimer}).rowcount == 1
    return connection.execute(_end_open, values).rowcount == 1
