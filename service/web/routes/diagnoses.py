"""The routes of diagnoses and of the adopted model."""

from functools import partial
from typing import Annotated

from fastapi import APIRouter, Header, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.answers import diagnoses
from service.api.diagnosis import DiagnosisIn, DiagnosisOut, DiagnosisPage, ModelIn, ModelOut, PlanOut
from service.api.parameters import ClutchId, DiagnosisId
from service.changes import adopt_model, run_diagnosis
from service.logging import request_id
from service.web import responses
from service.web.auth import Ingester, grant_of, require_scope
from service.web.limits import WAIT_SECONDS
from service.web.problems import READING, SENDING

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["diagnosis"])

Prefer = Annotated[
    str | None,
    Header(max_length=200, description=f"`wait=SECONDS`: how long to wait for the report; default {WAIT_SECONDS}"),
]


@router.post(
    "/diagnoses",
    status_code=201,
    **responses.taking(
        DiagnosisIn, DiagnosisOut, {"adopt": False}, SENDING, {202: "The diagnosis still runs: ask again at `Location`"}
    ),
)
async def post_diagnosis(request: Request, context: Ingester, clutch_id: ClutchId, prefer: Prefer = None) -> Response:
    """Diagnose all runs of the clutch's present life. A request during a diagnosis of the same runs gets that diagnosis."""
    question = await responses.sent(request, DiagnosisIn)
    if question.adopt:
        require_scope(grant_of(request), "admin")
    diagnosis_id, _ = await run_in_threadpool(
        run_diagnosis.ask,
        context.database,
        clutch_id,
        by=grant_of(request).name,
        adopt=question.adopt,
        isolability=question.isolability,
        request=request_id.get(),
        most=context.settings.most_diagnoses,
        created_at=responses.now(),
    )
    context.jobs.wake()
    preferred = responses.preferred_wait(prefer)
    wait = WAIT_SECONDS if preferred is None else preferred
    look = partial(diagnoses.diagnosis, context.database, clutch_id, diagnosis_id)
    report = await responses.until_ended(look, lambda diagnosis: diagnosis.status != "running", wait)
    headers = {"Location": f"/v1/clutches/{clutch_id}/diagnoses/{diagnosis_id}"}
    if preferred is not None:
        headers["Preference-Applied"] = f"wait={wait}"
    status = 202 if report.status == "running" else 201
    return responses.json_answer(report, status, **headers)


@router.get("/diagnoses", response_model=DiagnosisPage, responses=READING)
async def list_diagnoses(of: responses.PageOf) -> Response:
    """Diagnoses without their maps and loops, newest first."""
    return await responses.answer(of.request, diagnoses.page, of.database, of.clutch_id, of.part)


@router.get("/diagnoses/{diagnosis_id}", response_model=DiagnosisOut, responses=READING)
async def read_diagnosis(of: responses.Of, diagnosis_id: DiagnosisId) -> Response:
    """One diagnosis with its maps and loops."""
    return await responses.answer(of.request, diagnoses.diagnosis, of.database, of.clutch_id, diagnosis_id)


@router.get("/diagnoses/{diagnosis_id}/plan", response_model=PlanOut, responses=READING)
async def read_plan(of: responses.Of, diagnosis_id: DiagnosisId) -> Response:
    """The tests that a diagnosis advises as a protocol that a rig can run."""
    return await responses.answer(of.request, diagnoses.plan, of.database, of.clutch_id, diagnosis_id)


@router.get("/model", response_model=ModelOut, responses=READING)
async def read_model(of: responses.Of) -> Response:
    """The current model of tracking and remaining life, and all adopted versions."""
    return await responses.answer(of.request, diagnoses.model, of.database, of.clutch_id)


@router.put("/model", **responses.taking(ModelIn, ModelOut, {"diagnosis_id": "3f9a1c0b7d2e4f56"}, SENDING))
async def put_model(of: responses.ChangeOf) -> Response:
    """Adopt the extended model of a diagnosis, or return to the baseline. The clutch is tracked again before the answer."""
    model = await responses.sent(of.request, ModelIn)
    await responses.changed(of, adopt_model.adopt, model.diagnosis_id, responses.now(), grant_of(of.request).name)
    return responses.json_answer(await run_in_threadpool(diagnoses.model, of.database, of.clutch_id))
