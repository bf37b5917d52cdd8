"""Clutches: register, list worst first, look up, edit and archive, and the audit trail."""

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.queries import clutch_list, runs
from service.run_files.json_run import checked
from service.schemas.clutch import ClutchEdit, ClutchIn, ClutchOut, ClutchPage
from service.schemas.parameters import Archived, ClutchId
from service.schemas.run import ChangePage
from service.web.answers import (
    JSON_TYPE,
    answer,
    clutch_answer,
    described_body,
    from_cursor,
    json_body,
    now,
    page,
    tagged,
    to_json,
)
from service.web.auth import Ingester, Reader, name_of_caller
from service.web.context import Context, Cursor, Limit
from service.web.limits import USUAL_ITEMS
from service.web.problems import CHANGING, READING, SENDING
from service.workflows import register_clutch as registration
from service.workflows.edit_clutch import edit

router = APIRouter(prefix="/v1/clutches", tags=["clutches"])

EXAMPLE = {
    "clutch_id": "bench3-017",
    "geometry": {"inner_diameter_mm": 99, "outer_diameter_mm": 133, "friction_faces": 2},
    "oil": {"kinematic_viscosity_40c_cst": 56, "kinematic_viscosity_100c_cst": 9.3},
    "end_of_life": {"cof_fraction": 0.5},
    "friction_material": "paper",
    "reaction_plate": "steel",
    "fluid": "ATF",
}


@router.post(
    "",
    status_code=201,
    response_model=ClutchOut,
    responses=SENDING | {200: {"model": ClutchOut, "description": "Known already, with the same content"}},
    openapi_extra=described_body(ClutchIn, EXAMPLE),
)
async def register_clutch(request: Request, context: Ingester) -> Response:
    """Register a clutch. Everything but `clutch_id` has a default: the reference's clutch."""
    body = await json_body(request)
    clutch, new = await run_in_threadpool(_register, context, body)
    headers = {"Location": f"/v1/clutches/{clutch['clutch_id']}"}
    return Response(content=to_json(clutch), status_code=201 if new else 200, media_type=JSON_TYPE, headers=headers)


def _register(context: Context, body: bytes) -> tuple[dict[str, object], bool]:
    clutch = checked(ClutchIn, body)
    new = registration.register(context.database, clutch, created_at=now())
    return clutch_list.look_up(context.database, clutch.clutch_id), new


@router.get("", response_model=ClutchPage, responses=READING)
def list_clutches(
    request: Request, context: Reader, archived: Archived = False, limit: Limit = USUAL_ITEMS, cursor: Cursor = None
) -> Response:
    """All clutches with current health and remaining life, the fewest remaining cycles first."""
    after = from_cursor(cursor)
    version = context.database.version()  # before the rows are read: what is committed meanwhile makes another

    def make() -> bytes:
        return to_json(page(*clutch_list.page(context.database, limit=limit, after=after, archived=archived)))

    return tagged(request, context.cache.answer((version, archived, limit, after), make), JSON_TYPE)


@router.get("/{clutch_id}", response_model=ClutchOut, responses=READING)
def read_clutch(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """One clutch."""
    return answer(request, clutch_list.look_up(context.database, clutch_id))


@router.patch(
    "/{clutch_id}",
    response_model=ClutchOut,
    responses=CHANGING,
    openapi_extra=described_body(
        ClutchEdit, {"reason": "the drawing says so", "geometry": {"inner_diameter_mm": 98, "outer_diameter_mm": 133}}
    ),
)
async def edit_clutch(request: Request, context: Ingester, clutch_id: ClutchId) -> Response:
    """Edit a clutch's record, each given field as a whole, and archive it or bring it back; results are computed anew."""
    wanted = checked(ClutchEdit, await json_body(request))
    clutch = await run_in_threadpool(_edit, context, clutch_id, wanted, name_of_caller(request))
    return Response(content=to_json(clutch), media_type=JSON_TYPE)


def _edit(context: Context, clutch_id: str, wanted: ClutchEdit, by: str) -> dict[str, object]:
    edit(context.database, clutch_id, wanted.fields(), archived=wanted.archived, reason=wanted.reason, by=by, at=now())
    return clutch_list.look_up(context.database, clutch_id)


@router.get("/{clutch_id}/changes", response_model=ChangePage, responses=READING)
def list_changes(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = USUAL_ITEMS, cursor: Cursor = None
) -> Response:
    """Who changed what of the clutch and its runs, when and why: the newest first."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*runs.trail(context.database, clutch_id, limit=limit, after=after))

    return clutch_answer(request, context, clutch_id, "changes", make, limit, after)
