"""Starts a diagnosis as a job, and stores its result."""

import secrets
from collections.abc import Callable, Mapping
from typing import Any

from service import repository
from service.clutch.timeline import lives_of
from service.errors import BusyError
from service.settings import CODE_VERSION
from storage import changes, diagnoses, jobs
from storage.diagnoses import DiagnosisRow
from storage.engine.database import Database
from storage.jobs import DIAGNOSIS, JobRow


def ask(
    database: Database,
    clutch_id: str,
    *,
    by: str,
    adopt: bool,
    request: str,
    most: int,
    created_at: str,
    isolability: bool = False,
) -> tuple[str, bool]:
    """Queue a diagnosis of all present runs; returns its id and whether it is new (an open one of the same runs is
    reused).

    `adopt`: its finding is adopted in the name of `by`; `isolability`: it also reports which causes its tests could
    tell apart; `request`: the id of the asking request. Raises NotFoundError, BusyError if `most` wait or run already.
    """
    with database.writing(of=clutch_id) as connection:
        clutch = repository.clutch(connection, clutch_id)
        last_run_key = diagnoses.last_run_key(connection, clutch_id)
        changed = changes.last_of_history(connection, clutch_id)
        for diagnosis_id in diagnoses.running(connection, clutch_id, last_run_key, since=changed):
            job = jobs.get(connection, diagnosis_id)
            if job is None or job.state not in jobs.OPEN:  # its end could not be stored
                continue
            if isolability and not job.arguments.get("isolability"):
                continue
            if adopt and job.arguments["adopt_by"] is None:
                jobs.set_arguments(connection, job.job_id, job.arguments | {"adopt_by": by})
            return job.job_id, False
        waiting = jobs.count_open(connection, DIAGNOSIS)
        if waiting >= most:
            raise BusyError(f"{waiting} diagnoses already wait: try again later")
        lives = lives_of(repository.events(connection, clutch_id))
        row = DiagnosisRow(
            clutch_id=clutch_id,
            diagnosis_id=secrets.token_hex(8),
            created_at=created_at,
            revision=clutch.revision,
            last_run_key=last_run_key,
            life=lives[-1].name if lives else "",
            as_of_cycles=lives[-1].events[-1].cycles if lives else None,
            code_version=CODE_VERSION,
        )
        diagnoses.insert(connection, row)
        arguments = {
            "last_run_key": last_run_key,
            "adopt_by": by if adopt else None,
            "isolability": isolability,
            "request": request,
        }
        job_row = JobRow(
            job_id=row.diagnosis_id,
            kind=DIAGNOSIS,
            clutch_id=clutch_id,
            asked_at=created_at,
            asked_by=by,
            arguments=arguments,
        )
        jobs.insert(connection, job_row)
    return row.diagnosis_id, True


def finish(
    database: Database,
    job: JobRow,
    ended: Mapping[str, Any],
    *,
    at: str,
    adopt: Callable[[JobRow, Mapping[str, Any]], bool],
) -> None:
    """Store the end of a claimed job's diagnosis: its `report` and `extension`, or its `problem`.

    If the asker wanted the finding adopted, `adopt` does both at once; it returns false if there is nothing to adopt.
    Nothing is stored if the job is no longer the claimer's, because it was cancelled or claimed by another service.
    """
    for _ in repository.attempts(job.clutch_id or ""):
        with database.reading() as connection:
            newest = jobs.get(connection, job.job_id)
        if newest is None or newest.clutch_id is None:
            raise LookupError(f"job {job.job_id!r} of {job.clutch_id!r} is not stored")
        if newest.arguments["adopt_by"] is not None and "report" in ended and adopt(newest, ended):
            return
        with database.writing(of=newest.clutch_id) as connection:
            now = jobs.get(connection, job.job_id)
            if now is None or now.arguments != newest.arguments:  # somebody joined who wants it adopted
                continue
            problem = ended.get("problem")
            state = jobs.FINISHED if problem is None else jobs.FAILED
            if jobs.end(connection, job.job_id, state, at, problem=problem, claimer=job.claimed_by):
                if problem is None:
                    diagnoses.finish(connection, job.job_id, at, ended["report"], ended["extension"])
                    repository.note_dispute(connection, newest.clutch_id)
                else:
                    diagnoses.fail(connection, job.job_id, at, problem)
            return
