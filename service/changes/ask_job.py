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
    """Queue a job of a kind, for a clutch or None: all; if the same job already waits or runs, that one is returned.

    `request`: the id of the asking request. Raises NotFoundError, and BusyError if `most` jobs of the kind wait or run.
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
    """Store how a claimed job ended: its `result` with its last progress, or its `problem`.

    Nothing is stored if the job is no longer the claimer's, because it was cancelled or claimed by another service.
    """
    problem = ended.get("problem")
    progress = None if problem is not None else ended["progress"] | {"result": ended["result"]}
    state = jobs.FINISHED if problem is None else jobs.FAILED
    with database.writing(of=job.clutch_id) as connection:
        jobs.end(connection, job.job_id, state, at, problem=problem, claimer=job.claimed_by, progress=progress)


def cancel(database: Database, row: JobRow, *, by: str, at: str) -> JobRow:
    """Cancel a job, and the diagnosis it makes if any, in the name of `by`; returns its new state.

    A job that has ended is left unchanged. Raises NotFoundError.
    """
    problem = f"cancelled by {by}"
    with database.writing(of=row.clutch_id) as connection:
        if jobs.end(connection, row.job_id, jobs.CANCELLED, at, problem=problem):
            diagnoses.fail(connection, row.job_id, at, problem)
        return found(jobs.get(connection, row.job_id), "job", row.job_id)
