"""Diagnoses: asked for, listed, looked up; and the model that a clutch is tracked under."""

import asyncio
import re
from typing import Annotated, Any, TypeVar

import pydantic
from fastapi import APIRouter, Header, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.run_files.json_run import invalid
from service.schemas.base import Schema
from service.schemas.diagnosis import DiagnosisIn, DiagnosisOut, DiagnosisPage, ModelIn, ModelOut
from service.schemas.parameters import ClutchId, DiagnosisId
from service.web.bodies import described_body, json_body
from service.web.context import Context, Cursor, Ingester, Limit, Reader
from service.web.pages import JSON_TYPE, answer, encode, from_cursor, page
from service.web.problems import READING, SENDING
from service.workflows import adopt_model, run_diagnosis

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["diagnosis"])

#: Seconds that a POST waits for its report where it does not say, and at most.
WAIT, LONGEST_WAIT = 30, 600
_WAIT = re.compile(r'(?:^|[,;\s])wait\s*=\s*"?(\d{1,9})"?\s*(?:$|[,;])', re.IGNORECASE)

Body = TypeVar("Body", bound=Schema)
Prefer = Annotated[
    str | None, Header(max_length=200, description=f"`wait=SECONDS`: how long to wait for the report; default {WAIT}")
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
    asked = _read(DiagnosisIn, await json_body(request))
    job = await run_in_threadpool(context.worker.ask, clutch_id, adopt=asked.adopt)
    preferred = _WAIT.search(prefer or "")
    wait = WAIT if preferred is None else min(int(preferred[1]), LONGEST_WAIT)
    await asyncio.wait([asyncio.wrap_future(job.done)], timeout=wait)
    said = await run_in_threadpool(run_diagnosis.one, context.database, clutch_id, job.diagnosis_id)
    headers = {"Location": f"/v1/clutches/{clutch_id}/diagnoses/{job.diagnosis_id}"}
    if preferred is not None:
        headers["Preference-Applied"] = f"wait={wait}"
    status = 202 if said["status"] == "running" else 201
    return Response(content=encode(said), status_code=status, media_type=JSON_TYPE, headers=headers)


@router.get("/diagnoses", response_model=DiagnosisPage, responses=READING)
def list_diagnoses(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """Diagnoses without their maps and loops, newest first."""
    items, after = run_diagnosis.page(context.database, clutch_id, limit=limit, after=from_cursor(cursor))
    return answer(request, page(items, after))


@router.get("/diagnoses/{diagnosis_id}", response_model=DiagnosisOut, responses=READING)
def read_diagnosis(request: Request, context: Reader, clutch_id: ClutchId, diagnosis_id: DiagnosisId) -> Response:
    """One diagnosis with its maps and loops."""
    return answer(request, run_diagnosis.one(context.database, clutch_id, diagnosis_id))


@router.get("/model", response_model=ModelOut, responses=READING)
def read_model(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """The model that tracking and remaining life use, and all that were adopted."""
    return answer(request, adopt_model.model(context.database, clutch_id))


@router.put(
    "/model",
    response_model=ModelOut,
    responses=SENDING,
    openapi_extra=described_body(ModelIn, {"diagnosis_id": None}),
)
async def put_model(request: Request, context: Ingester, clutch_id: ClutchId) -> Response:
    """Adopt what a diagnosis found, or return to the baseline; all is tracked anew before this is answered."""
    asked = _read(ModelIn, await json_body(request))
    said = await run_in_threadpool(_adopt, context, clutch_id, asked.diagnosis_id)
    return Response(content=encode(said), media_type=JSON_TYPE)


def _adopt(context: Context, clutch_id: str, diagnosis_id: str | None) -> dict[str, Any]:
    with context.database.writing() as connection:
        return adopt_model.adopt(connection, clutch_id, diagnosis_id, adopted_at=context.now())


def _read(schema: type[Body], body: bytes) -> Body:
    try:
        return schema.model_validate_json(body)
    except pydantic.ValidationError as error:
        raise invalid(error) from None
