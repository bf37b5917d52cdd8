"""The table of jobs: waiting, running, finished, failed or cancelled. Lists begin with the newest.

A job is claimed by a process, which counts up that it holds the job while it works (a lease). Whoever has seen no such
renewal for a while, by a clock of its own, may claim the job again: its process was killed. No moment is stored, so it does
not matter when anybody's wall clock is set. On PostgreSQL rows that another claim has just locked are passed over;
on SQLite one process writes at a time anyway.
"""

from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, and_, exists, func, or_, select, update

from storage.dialects import among, newest_first
from storage.encoding import Json, to_text
from storage.rows import Rows
from storage.tables import OPEN_ONLY, job

WAITING, RUNNING, FINISHED, FAILED, CANCELLED = "waiting", "running", "finished", "failed", "cancelled"
#: The states of a job that has not ended.
OPEN = (WAITING, RUNNING)
#: The kinds of job that there are.
DIAGNOSIS, REPLAY, FLEET_REFRESH = "diagnosis", "replay", "fleet_refresh"


@dataclass(frozen=True, slots=True, kw_only=True)
class JobRow:
    """A job: `clutch_id` None if it is not about one clutch, `arguments` those of its kind, `attempts` the number of
    times it was begun; later jobs have greater keys.
    """

    job_id: str
    kind: str
    clutch_id: str | None
    asked_at: str
    asked_by: str
    arguments: Json
    job_key: int = 0
    state: str = WAITING
    attempts: int = 0
    claimed_by: str | None = None
    started_at: str | None = None
    finished_at: str | None = None
    progress: Json | None = None
    problem: str | None = None

    @property
    def of(self) -> str | None:
        """The job's subject: a clutch, or the key of a kind of clutches; None: all clutches."""
        return self.clutch_id or self.arguments.get("fleet")


@dataclass(frozen=True, slots=True)
class Hold:
    """A running job, with its count of claims and renewals, which stays the same until its process renews it."""

    job_id: str
    renewals: int


_rows = Rows(JobRow, key="job_key")
#: The clutch that was served longest ago comes first, then the job that was asked for first: however many of its jobs wait,
#: a clutch holds up another's by one. Jobs of no clutch come before all.
_of_same = job.alias("of_same")
_served = select(func.max(_of_same.c.started_at)).where(_of_same.c.clutch_id == job.c.clutch_id).scalar_subquery()
_next = (
    select(job.c.job_id)
    .order_by(_served.asc().nulls_first(), job.c.job_key)
    .limit(1)
    .with_for_update(skip_locked=True, of=job)
)


def insert(connection: Connection, row: JobRow) -> None:
    """Store a waiting job. Raises IntegrityError where its clutch is unknown or its id taken."""
    connection.execute(job.insert(), _rows.values(row))


def get(connection: Connection, job_id: str) -> JobRow | None:
    return _rows.first(connection.execute(select(job).where(job.c.job_id == job_id)))


def page(
    connection: Connection,
    *,
    limit: int,
    before: float | None = None,
    state: str | None = None,
    only: Collection[str] | None = None,
) -> list[JobRow]:
    """At most `limit` jobs, newest first, in that state, limited to the clutches `only`; `before`: the key of the
    previous page's last job."""
    query = newest_first(select(job), job.c.job_key, before=before, limit=limit)
    if state is not None:
        query = query.where(job.c.state == state)
    if only is not None:
        query = query.where(among(job.c.clutch_id, list(only)))
    return _rows.all(connection.execute(query))


def count_open(connection: Connection, kind: str) -> int:
    return connection.execute(select(func.count()).select_from(job).where(OPEN_ONLY, job.c.kind == kind)).scalar_one()


def open_of(connection: Connection, kind: str) -> list[JobRow]:
    """The waiting and running jobs of a kind, oldest first."""
    query = select(job).where(OPEN_ONLY, job.c.kind == kind).order_by(job.c.job_key)
    return _rows.all(connection.execute(query))


def holds(connection: Connection, kinds: Collection[str]) -> list[Hold]:
    """The holds of the running jobs of these kinds."""
    query = select(job.c.job_id, job.c.renewals).where(OPEN_ONLY, job.c.kind.in_(kinds), job.c.state == RUNNING)
    return [Hold(*row) for row in connection.execute(query)]


def _free(kinds: Collection[str], abandoned: Collection[Hold]) -> ColumnElement[bool]:
    """The condition that a job of these kinds waits, or is held by one of these expired holds."""
    held = [and_(job.c.job_id == hold.job_id, job.c.renewals == hold.renewals) for hold in abandoned]
    return and_(OPEN_ONLY, job.c.kind.in_(kinds), or_(job.c.state == WAITING, *held))


def any_free(connection: Connection, kinds: Collection[str], abandoned: Collection[Hold] = ()) -> bool:
    return bool(connection.execute(select(exists(select(job.c.job_key).where(_free(kinds, abandoned))))).scalar_one())


def claim(
    connection: Connection, claimer: str, kinds: Collection[str], *, at: str, abandoned: Collection[Hold] = ()
) -> JobRow | None:
    """Claim the next free job of these kinds for the claimer; None if none is free."""
    job_id: str | None = connection.execute(_next.where(_free(kinds, abandoned))).scalar()
    if job_id is None:
        return None
    claimed = {"state": RUNNING, "claimed_by": claimer, "renewals": job.c.renewals + 1, "started_at": at}
    this = update(job).where(job.c.job_id == job_id)
    connection.execute(this.values(attempts=job.c.attempts + 1, progress=None, **claimed))
    return get(connection, job_id)


def _claimed(job_id: str, claimer: str) -> ColumnElement[bool]:
    return and_(job.c.job_id == job_id, job.c.state == RUNNING, job.c.claimed_by == claimer)


def renew(connection: Connection, job_id: str, claimer: str, *, progress: Json | None) -> bool:
    """Renew the claimer's hold on the job; false if the job was cancelled or claimed by another."""
    held = {"renewals": job.c.renewals + 1} | _rows.columns(progress=progress)
    return connection.execute(update(job).where(_claimed(job_id, claimer)).values(held)).rowcount == 1


def release(connection: Connection, job_id: str, claimer: str) -> None:
    """Return the claimer's job to the queue; the attempt does not count."""
    waiting = {"state": WAITING, "attempts": job.c.attempts - 1, "claimed_by": None}
    connection.execute(update(job).where(_claimed(job_id, claimer)).values(waiting))


def release_all(connection: Connection) -> None:
    """Return all running jobs to the queue, because no process runs that could hold one."""
    connection.execute(update(job).where(job.c.state == RUNNING).values(state=WAITING, claimed_by=None))


def set_arguments(connection: Connection, job_id: str, arguments: Json) -> None:
    connection.execute(update(job).where(job.c.job_id == job_id).values(arguments=to_text(arguments)))


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
    """Store how a job ended; false if it has ended already or, if a `claimer` is named, is held by another.

    `progress` None: the stored progress stays.
    """
    ended: dict[str, object] = {"state": state, "finished_at": at, "problem": problem}
    if progress is not None:
        ended["progress"] = to_text(progress)
    this = (job.c.job_id == job_id) & OPEN_ONLY if claimer is None else _claimed(job_id, claimer)
    return connection.execute(update(job).where(this).values(ended)).rowcount == 1
