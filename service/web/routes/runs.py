"""Runs: post, list, look up."""

import asyncio
from functools import partial

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.jobs.workers import Lane
from service.lists import from_cursor, page
from service.queries import runs
from service.queries.cache import to_json
from service.run_files.json_run import read_run
from service.schemas.parameters import ClutchId, RunId
from service.schemas.run import RUN_IN, Receipt, RunOut, RunPage
from service.web.answers import JSON_TYPE, answer, clutch_answer, described_body, json_body, now
from service.web.auth import Ingester, Reader
from service.web.context import Cursor, Limit
from service.web.limits import LARGE_BODY_BYTES, USUAL_ITEMS
from service.web.problems import READING, SENDING
from service.workflows.ingest_run import ingest_posted

router = APIRouter(prefix="/v1/clutches/{clutch_id}/runs", tags=["runs"])

EXAMPLE = {
    "run_id": "2026-11-02-stationary-7000",
    "kind": "stationary_stribeck",
    "cycles": 7000,
    "started_at": "2026-11-02T08:00:00+01:00",
    "channels": {
        "pressure_bar": [5, 5, 5, 5, 5],
        "speed_rpm": [20, 120, 520, 1020, 1970],
        "torque_nm": [21.9, 22.8, 22.4, 21.5, 20.8],
        "oil_temperature_c": [84.1, 84.3, 84.9, 85.2, 85.6],
    },
}


@router.post(
    "",
    status_code=201,
    response_model=Receipt,
    responses=SENDING | {200: {"model": Receipt, "description": "The same run again: the same receipt"}},
    openapi_extra=described_body(RUN_IN.json_schema(), EXAMPLE),
)
async def post_run(request: Request, context: Ingester, clutch_id: ClutchId) -> Response:
    """Post a run, in any order of cycles. The receipt says what was made of it; by then it is stored for good."""
    body = await json_body(request)
    lane = Lane.RUNS if len(body) <= LARGE_BODY_BYTES else Lane.FILES
    taken_in = context.workers.submit(lane, ingest_posted, clutch_id, partial(read_run, body), now(), turn=clutch_id)
    receipt, new = await asyncio.wrap_future(taken_in)
    headers = {"Location": f"/v1/clutches/{clutch_id}/runs/{receipt['run_id']}"}
    return Response(content=to_json(receipt), status_code=201 if new else 200, media_type=JSON_TYPE, headers=headers)


@router.get("", response_model=RunPage, responses=READING)
async def list_runs(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = USUAL_ITEMS, cursor: Cursor = None
) -> Response:
    """Receipts by cycles."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*runs.page(context.database, clutch_id, limit=limit, after=after))

    return await clutch_answer(request, context, clutch_id, "runs", make, limit, after)


@router.get("/{run_id}", response_model=RunOut, responses=READING)
async def read_run_with_channels(request: Request, context: Reader, clutch_id: ClutchId, run_id: RunId) -> Response:
    """One receipt with the run's channels as they were sent."""
    return await answer(request, lambda: runs.one_run(context.database, clutch_id, run_id))
