"""A replay or a fleet refresh is asked for as a job, which stores what it computes; its end is stored when it has come.

A job is cancelled: it is not begun any more, and where it runs its process learns of it and ends it.
"""

import secrets
from collections.abc import Mapping
from typing import Any

from service import repository
from service.errors import BusyError, found
from storage import diagnoses, jobs
from storage.engine.database import Database
from storage.jobs import JobRow


def ask(
    database: Database, kind: str, clutch_id: str | None, *, by: str, request: str, most: int, asked_at: str
) -> JobRow:
    """Ask for a job of a kind, of a clutch or None: of all; where the same waits or runs already it is that one.

    `request` is the id of the request that asks. Raises NotFoundError, BusyError where `most` of the kind wait or run.
    """
    with database.writing(of=kind) as connection:  # who asks for one of the same kind meanwhile waits
        if clutch_id is not None:
            repository.clutch(connection, clutch_id)
        already = jobs.open_of(connection, kind)
        for row in already:
            # a fleet refresh that has learned already and only predicts again would miss what came since
            if row.of == clutch_id and not row.arguments.get("learned", False):
                return row
        if len(already) >= most:
            raise BusyError(f"{len(already)} jobs of the kind {kind} already wait: try again later")
        job_id = secrets.token_hex(8)
        new = JobRow(
            job_id=job_id,
            kind=kind,
            clutch_id=clutch_id,
            asked_at=asked_at,
            asked_by=by,
            arguments={"request": request},
        )
        jobs.insert(connection, new)
        return found(jobs.get(connection, job_id), "job", job_id)


def finish(database: Database, job: JobRow, ended: Mapping[str, Any], *, at: str) -> None:
    """Store how a claimed job ended: its `result`, with how far it had come, or its `problem`.

    Nothing is stored of a job that is no longer the claimer's: it was cancelled, or another does it.
    """
    problem = ended.get("problem")
    progress = None if problem is not None else ended["progress"] | {"result": ended["result"]}
    state = jobs.FINISHED if problem is None else jobs.FAILED
    with database.writing(of=job.clutch_id) as connection:
        jobs.end(connection, job.job_id, state, at, problem=problem, claimer=job.claimed_by, progress=progress)


def cancel(database: Database, row: JobRow, *, by: str, at: str) -> JobRow:
    """Cancel a job in the name of `by`, and with it the diagnosis of that name, if it is one's; returns it as it is then.

    One that has ended stays as it is. Raises NotFoundError.
    """
    problem = f"cancelled by {by}"
    with database.writing(of=row.clutch_id) as connection:
        if jobs.end(connection, row.job_id, jobs.CANCELLED, at, problem=problem):
            diagnoses.fail(connection, row.job_id, at, problem)
        return found(jobs.get(connection, row.job_id), "job", row.job_id)
