"""`/v1/jobs`: what waits, runs and has ended, as it is answered."""

from collections.abc import Collection

from service.api.base import of_row
from service.api.diagnosis import JobOut, JobPage
from service.errors import found
from service.paging import Part, by_key
from storage import jobs
from storage.engine.database import Database
from storage.jobs import JobRow


def find(database: Database, job_id: str, *, only: Collection[str] | None) -> JobRow:
    """The job, if it concerns one of the clutches `only`. Raises NotFoundError, also for a job of other clutches."""
    with database.reading() as connection:
        return found(jobs.get(connection, job_id), "job", job_id, only=only)


def page(database: Database, part: Part, *, state: str | None, only: Collection[str] | None) -> JobPage:
    """A page of jobs in that state, limited to the clutches `only`, newest first."""
    with database.reading() as connection:
        rows = jobs.page(connection, limit=part.most, before=part.number, state=state, only=only)
    return part.of(JobPage, rows, by_key("job_key"), shown)


def shown(row: JobRow) -> JobOut:
    """A job with its progress and, once it has ended, its result."""
    progress = dict(row.progress or {})
    result = progress.pop("result", None)
    return of_row(JobOut, row, progress=None if row.progress is None else progress, result=result)
