"""Jobs: what waits, runs and has ended, whichever service has it; and cancelled."""

from functools import partial

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.jobs import listing
from service.lists import from_cursor, page
from service.queries.cache import to_json
from service.schemas.diagnosis import JobOut, JobPage
from service.schemas.parameters import JobId, OfState
from service.web.answers import JSON_TYPE, answer, now
from service.web.auth import OwnAdmin, OwnReader, name_of_caller, own_clutches
from service.web.context import Cursor, Limit
from service.web.limits import USUAL_ITEMS
from service.web.problems import READING
from service.workflows import cancel_job

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


@router.get("", response_model=JobPage, responses=READING)
async def list_jobs(
    request: Request, context: OwnReader, state: OfState = None, limit: Limit = USUAL_ITEMS, cursor: Cursor = None
) -> Response:
    """Jobs of the clutches that the key is for, newest first."""
    after, own = from_cursor(cursor), own_clutches(request)
    listed = partial(listing.page, context.database, limit=limit, after=after, state=state, only=own)
    return await answer(request, lambda: page(*listed()))


@router.get("/{job_id}", response_model=JobOut, responses=READING)
async def read_job(request: Request, context: OwnReader, job_id: JobId) -> Response:
    """One job, how far it has come and how it ended."""
    own = own_clutches(request)
    return await answer(request, lambda: listing.shown(listing.find(context.database, job_id, only=own)))


@router.delete("/{job_id}", response_model=JobOut, responses=READING)
async def delete_job(request: Request, context: OwnAdmin, job_id: JobId) -> Response:
    """Cancel a job: one that waits is not begun, one that runs is ended in seconds. One that has ended stays as it is."""
    row = await run_in_threadpool(listing.find, context.database, job_id, only=own_clutches(request))
    cancel = partial(cancel_job.cancel, context.database, row, by=name_of_caller(request), at=now())
    cancelled = await run_in_threadpool(cancel)
    return Response(content=to_json(listing.shown(cancelled)), media_type=JSON_TYPE)
