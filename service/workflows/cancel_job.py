"""A job is cancelled: it is not begun any more, and where it runs its process learns of it and ends it."""

from service.errors import NotFoundError
from storage import diagnoses, jobs
from storage.engine.database import Database
from storage.jobs import JobRow


def cancel(database: Database, row: JobRow, *, by: str, at: str) -> JobRow:
    """Cancel a job in the name of `by`, and with it the diagnosis of that name, if it is one's; returns it as it is then.

    One that has ended stays as it is. Raises NotFoundError.
    """
    problem = f"cancelled by {by}"
    with database.writing(of=row.clutch_id) as connection:
        if jobs.end(connection, row.job_id, jobs.CANCELLED, at, problem=problem):
            diagnoses.fail(connection, row.job_id, at, problem)
        ended = jobs.get(connection, row.job_id)
    if ended is None:
        raise NotFoundError(f"no job is known as {row.job_id!r}")
    return ended
