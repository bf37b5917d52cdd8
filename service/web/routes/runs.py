"""Runs: post, list, look up, and what is changed of them afterwards."""

from collections.abc import Callable
from typing import Any

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.queries import runs
from service.run_files.json_run import checked, read_run
from service.schemas.parameters import ClutchId, RunId, State
from service.schemas.run import RUN_IN, Confirmation, Correction, Receipt, RunOut, RunPage, Withdrawal
from service.web.answers import (
    JSON_TYPE,
    answer,
    clutch_answer,
    described_body,
    from_cursor,
    json_body,
    now,
    page,
    to_json,
)
from service.web.auth import Ingester, Reader, name_of_caller
from service.web.context import Context, Cursor, Limit
from service.web.limits import USUAL_ITEMS
from service.web.problems import CHANGING, READING, SENDING
from service.workflows import change_run
from service.workflows.ingest_run import ingest

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
    receipt, new = await run_in_threadpool(_ingest, context, clutch_id, body, name_of_caller(request))
    headers = {"Location": f"/v1/clutches/{clutch_id}/runs/{receipt['run_id']}"}
    return Response(content=to_json(receipt), status_code=201 if new else 200, media_type=JSON_TYPE, headers=headers)


def _ingest(context: Context, clutch_id: str, body: bytes, by: str) -> tuple[dict[str, Any], bool]:
    return ingest(context.database, clutch_id, read_run(body), received_at=now(), by=by)


@router.get("", response_model=RunPage, responses=READING)
def list_runs(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    state: State = None,
    limit: Limit = USUAL_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """Receipts by cycles."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*runs.page(context.database, clutch_id, limit=limit, after=after, state=state))

    return clutch_answer(request, context, clutch_id, "runs", make, state, limit, after)


@router.get("/{run_id}", response_model=RunOut, responses=READING)
def read_run_with_channels(request: Request, context: Reader, clutch_id: ClutchId, run_id: RunId) -> Response:
    """One receipt with the run's channels as they were sent, and what was changed of it."""
    return answer(request, runs.one_run(context.database, clutch_id, run_id))


@router.patch(
    "/{run_id}",
    response_model=Receipt,
    responses=CHANGING,
    openapi_extra=described_body(Correction, {"cycles": 7000, "reason": "typed a zero too many"}),
)
async def correct_run(request: Request, context: Ingester, clutch_id: ClutchId, run_id: RunId) -> Response:
    """Correct a run's cycles; it counts where it is plausible there. What was sent stays stored."""
    wanted = checked(Correction, await json_body(request))
    return await _changed(
        change_run.correct, request, context, clutch_id, run_id, cycles=wanted.cycles, reason=wanted.reason
    )


@router.post(
    "/{run_id}/withdraw",
    response_model=Receipt,
    responses=CHANGING,
    openapi_extra=described_body(Withdrawal, {"reason": "the torque sensor was unplugged"}),
)
async def withdraw_run(request: Request, context: Ingester, clutch_id: ClutchId, run_id: RunId) -> Response:
    """Take a run out of the clutch's history. It stays stored and listed."""
    wanted = checked(Withdrawal, await json_body(request))
    return await _changed(change_run.withdraw, request, context, clutch_id, run_id, reason=wanted.reason)


@router.post(
    "/{run_id}/restore",
    response_model=Receipt,
    responses=CHANGING,
    openapi_extra=described_body(Withdrawal, {"reason": "it was the other sensor"}),
)
async def restore_run(request: Request, context: Ingester, clutch_id: ClutchId, run_id: RunId) -> Response:
    """Take a withdrawal back: the run is accepted or held as it was before."""
    wanted = checked(Withdrawal, await json_body(request))
    return await _changed(change_run.restore, request, context, clutch_id, run_id, reason=wanted.reason)


@router.post(
    "/{run_id}/confirm",
    response_model=Receipt,
    responses=CHANGING,
    openapi_extra=described_body(Confirmation, {"reason": "the clutch was run over the weekend"}),
)
async def confirm_run(request: Request, context: Ingester, clutch_id: ClutchId, run_id: RunId) -> Response:
    """Accept a held run as it was sent."""
    wanted = checked(Confirmation, await json_body(request))
    return await _changed(change_run.confirm, request, context, clutch_id, run_id, reason=wanted.reason)


async def _changed(
    change: Callable[..., dict[str, Any]],
    request: Request,
    context: Context,
    clutch_id: str,
    run_id: str,
    **wanted: Any,
) -> Response:
    """The receipt after a change."""
    by, at = name_of_caller(request), now()
    receipt = await run_in_threadpool(change, context.database, clutch_id, run_id, **wanted, by=by, at=at)
    return Response(content=to_json(receipt), media_type=JSON_TYPE)
