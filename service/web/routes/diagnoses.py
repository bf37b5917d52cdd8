"""Diagnoses: asked for, listed, looked up; and the model that a clutch is tracked under."""

import asyncio
import re
from typing import Annotated, Any

from fastapi import APIRouter, Header, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.queries import diagnoses, model
from service.run_files.json_run import read_body
from service.schemas.diagnosis import DiagnosisIn, DiagnosisOut, DiagnosisPage, ModelIn, ModelOut
from service.schemas.parameters import ClutchId, DiagnosisId
from service.web.answers import JSON_TYPE, answer, described_body, from_cursor, json_body, now, page, to_json
from service.web.auth import Ingester, Reader
from service.web.context import Context, Cursor, Limit
from service.web.limits import LONGEST_WAIT_SECONDS, USUAL_ITEMS, WAIT_SECONDS
from service.web.problems import READING, SENDING
from service.workflows import adopt_model

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["diagnosis"])

_WAIT = re.compile(r'(?:^|[,;\s])wait\s*=\s*"?(\d{1,9})"?\s*(?:$|[,;])', re.IGNORECASE)

Prefer = Annotated[
    str | None,
    Header(max_length=200, description=f"`wait=SECONDS`: how long to wait for the report; default {WAIT_SECONDS}"),
]


@router.post(
    "/diagnoses",
    status_code=201,
    response_model=DiagnosisOut,
    responses=SENDING | {202: {"model": DiagnosisOut, "description": "It still runs: look again at `Location`"}},
    openapi_extra=described_body(DiagnosisIn, {"adopt": False}),
)
async def post_diagnosis(request: Request, context: Ingester, clutch_id: ClutchId, prefer: Prefer = None) -> Response:
    """Have all runs of the clutch's present life diagnosed. A question while the same runs are being diagnosed joins in."""
    question = read_body(DiagnosisIn, await json_body(request))
    job = await run_in_threadpool(context.diagnoses.ask, clutch_id, adopt=question.adopt)
    preferred = _WAIT.search(prefer or "")
    wait = WAIT_SECONDS if preferred is None else min(int(preferred[1]), LONGEST_WAIT_SECONDS)
    await asyncio.wait([asyncio.wrap_future(job.done)], timeout=wait)
    report = await run_in_threadpool(diagnoses.diagnosis, context.database, clutch_id, job.diagnosis.diagnosis_id)
    headers = {"Location": f"/v1/clutches/{clutch_id}/diagnoses/{job.diagnosis.diagnosis_id}"}
    if preferred is not None:
        headers["Preference-Applied"] = f"wait={wait}"
    status = 202 if report["status"] == "running" else 201
    return Response(content=to_json(report), status_code=status, media_type=JSON_TYPE, headers=headers)


@router.get("/diagnoses", response_model=DiagnosisPage, responses=READING)
def list_diagnoses(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = USUAL_ITEMS, cursor: Cursor = None
) -> Response:
    """Diagnoses without their maps and loops, newest first."""
    items, after = diagnoses.page(context.database, clutch_id, limit=limit, after=from_cursor(cursor))
    return answer(request, page(items, after))


@router.get("/diagnoses/{diagnosis_id}", response_model=DiagnosisOut, responses=READING)
def read_diagnosis(request: Request, context: Reader, clutch_id: ClutchId, diagnosis_id: DiagnosisId) -> Response:
    """One diagnosis with its maps and loops."""
    return answer(request, diagnoses.diagnosis(context.database, clutch_id, diagnosis_id))


@router.get("/model", response_model=ModelOut, responses=READING)
def read_model(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """The model that tracking and remaining life use, and all that were adopted."""
    return answer(request, model.model(context.database, clutch_id))


@router.put(
    "/model",
    response_model=ModelOut,
    responses=SENDING,
    openapi_extra=described_body(ModelIn, {"diagnosis_id": None}),
)
async def put_model(request: Request, context: Ingester, clutch_id: ClutchId) -> Response:
    """Adopt what a diagnosis found, or return to the baseline; all is tracked anew before this is answered."""
    wanted = read_body(ModelIn, await json_body(request))
    answered = await run_in_threadpool(_adopt, context, clutch_id, wanted.diagnosis_id)
    return Response(content=to_json(answered), media_type=JSON_TYPE)


def _adopt(context: Context, clutch_id: str, diagnosis_id: str | None) -> dict[str, Any]:
    adopt_model.adopt(context.database, clutch_id, diagnosis_id, adopted_at=now())
    return model.model(context.database, clutch_id)
