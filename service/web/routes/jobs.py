"""Jobs: replays and fleet refreshes asked for; what waits, runs and has ended, whichever service has it; and cancelled."""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Header, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.answers import jobs
from service.api.diagnosis import JobIn, JobOut, JobPage
from service.api.parameters import JobId, OfState
from service.changes import ask_job
from service.logging import request_id
from service.web.auth import OwnAdmin, OwnReader, grant_of, require_clutch
from service.web.problems import READING, SENDING
from service.web.responses import Paged, answer, json_answer, now, preferred_wait, sent, taking, until_ended
from storage.jobs import OPEN

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

Prefer = Annotated[
    str | None,
    Header(max_length=200, description="`wait=SECONDS`: how long to wait for the job's end; default: not at all"),
]


@router.post(
    "",
    status_code=202,
    **taking(
        JobIn,
        JobOut,
        {"kind": "replay", "clutch_id": "bench3-017"},
        SENDING,
        {200: "The job ended within the waiting time"},
    ),
)
async def post_job(request: Request, context: OwnAdmin, prefer: Prefer = None) -> Response:
    """Start a replay or a fleet refresh. If the same job already waits or runs, the answer is that job."""
    job_in = await sent(request, JobIn)
    require_clutch(grant_of(request), job_in.clutch_id)
    new_or_open = await run_in_threadpool(
        ask_job.ask,
        context.database,
        job_in.kind,
        job_in.clutch_id,
        by=grant_of(request).name,
        request=request_id.get(),
        most=context.settings.most_replays,
        asked_at=now(),
    )
    context.jobs.wake()
    wait = preferred_wait(prefer)
    look = partial(jobs.find, context.database, new_or_open.job_id, only=None)
    row = await until_ended(look, lambda job: job.state not in OPEN, wait or 0)
    headers = {"Location": f"/v1/jobs/{row.job_id}"}
    if wait is not None:
        headers["Preference-Applied"] = f"wait={wait}"
    status = 202 if row.state in OPEN else 200
    return json_answer(jobs.shown(row), status, **headers)


@router.get("", response_model=JobPage, responses=READING)
async def list_jobs(request: Request, context: OwnReader, part: Paged, state: OfState = None) -> Response:
    """Jobs of the key's clutches, newest first."""
    return await answer(request, jobs.page, context.database, part, state=state, only=grant_of(request).clutches)


@router.get("/{job_id}", response_model=JobOut, responses=READING)
async def read_job(request: Request, context: OwnReader, job_id: JobId) -> Response:
    """One job, with its progress and result."""
    row = await run_in_threadpool(jobs.find, context.database, job_id, only=grant_of(request).clutches)
    return await answer(request, jobs.shown, row)


@router.delete("/{job_id}", response_model=JobOut, responses=READING)
async def delete_job(request: Request, context: OwnAdmin, job_id: JobId) -> Response:
    """Cancel a job. A waiting job does not start, a running job ends within seconds, an ended job stays unchanged."""
    row = await run_in_threadpool(jobs.find, context.database, job_id, only=grant_of(request).clutches)
    cancelled = await run_in_threadpool(ask_job.cancel, context.database, row, by=grant_of(request).name, at=now())
    return json_answer(jobs.shown(cancelled))
