"""Clutches: register, list, count, look up, edit and archive, and the audit trail; and what the clutches show together: the
fleet's priors, and how right the predictions of all were."""

from collections.abc import Callable, Hashable
from functools import partial

from fastapi import APIRouter, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response

from service.answers import clutch_list, fleet_priors, runs, scores
from service.answers.degradation import degradation
from service.answers.store import to_json
from service.api.clutch import ClutchEdit, ClutchIn, ClutchOut, ClutchPage
from service.api.fleet import FleetPriorPage, FleetScores, FleetTotals, Scores
from service.api.life import Method
from service.api.parameters import Archived, ClutchId, ClutchStateName, Find, Held, Offset, Sort
from service.api.run import ChangePage
from service.changes import edit_clutch as registration
from service.changes.edit_clutch import edit
from service.web import auth, responses
from service.web.context import Context
from service.web.middleware import remember
from service.web.problems import READING, SENDING
from storage.clutches import ClutchSelection

router = APIRouter(prefix="/v1/clutches", tags=["clutches"])
fleet_router = APIRouter(prefix="/v1/fleet", tags=["fleet"])
#: Of the fleet: below `/v1/clutches`, `totals` would be a clutch's name.
totals_router = APIRouter(prefix="/v1/fleet", tags=["fleet"])

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
    **responses.taking(ClutchIn, ClutchOut, EXAMPLE, SENDING, {200: "Known already, with the same content"}),
)
async def register_clutch(request: Request, context: auth.OwnIngester) -> Response:
    """Register a clutch. Everything but `clutch_id` has a default: the reference's clutch."""
    fields = await responses.sent(request, ClutchIn)
    auth.require_clutch(auth.grant_of(request), fields.clutch_id)
    clutch, new = await run_in_threadpool(_register, context, fields)
    if new:
        await responses.begin_computed(context, clutch.clutch_id, degradation)
    return responses.json_answer(clutch, 201 if new else 200, Location=f"/v1/clutches/{clutch.clutch_id}")


def _register(context: Context, clutch: ClutchIn) -> tuple[ClutchOut, bool]:
    new = registration.register(context.database, clutch, created_at=responses.now())
    return clutch_list.look_up(context.database, clutch.clutch_id), new


@router.get("", response_model=ClutchPage, responses=READING)
async def list_clutches(
    request: Request,
    context: auth.OwnReader,
    part: responses.Paged,
    archived: Archived = False,
    state: ClutchStateName = None,
    held: Held = False,
    find: Find = "",
    sort: Sort = "worst",
    offset: Offset = 0,
) -> Response:
    """The clutches of the key, with health and remaining life: what needs somebody first, or by name. To read all
    of them, sort by name: then none is missed or repeated.
    """
    choice = ClutchSelection(archived=archived, only=auth.grant_of(request).clutches, state=state, held=held, find=find)
    make = partial(clutch_list.page_as_json, context.database, context.answers, choice, part, offset=offset, sort=sort)
    return await _answer_about_all_clutches(request, context, ("clutches", choice, part, offset, sort), make)


@totals_router.get("/totals", response_model=FleetTotals, responses=READING)
async def totals(request: Request, context: auth.OwnReader, archived: Archived = False, find: Find = "") -> Response:
    """The number of the key's clutches, by state."""
    choice = ClutchSelection(archived=archived, only=auth.grant_of(request).clutches, find=find)
    return await _answer_about_all_clutches(
        request, context, ("totals", choice), lambda: to_json(clutch_list.totals(context.database, choice))
    )


async def _answer_about_all_clutches(
    request: Request, context: Context, key: Hashable, make: Callable[[], bytes]
) -> Response:
    """The response to a GET about all clutches, cached until the database's next commit."""
    # the version before the rows are read: what is committed meanwhile makes another
    answer = await responses.cached_answer(context, key, auth.snapshot_of(request).version, make)
    if auth.grant_of(request).clutches is None:
        remember(request, responses.repeated_answer(context, key, of_clutch=False))
    return responses.tagged(request, answer, responses.JSON_TYPE)


@router.get("/{clutch_id}", response_model=ClutchOut, responses=READING)
async def read_clutch(request: Request, context: auth.Reader, clutch_id: ClutchId) -> Response:
    """One clutch."""
    return await responses.answer(request, clutch_list.look_up, context.database, clutch_id)


@router.patch(
    "/{clutch_id}",
    **responses.taking(
        ClutchEdit,
        ClutchOut,
        {"reason": "the drawing says so", "geometry": {"inner_diameter_mm": 98, "outer_diameter_mm": 133}},
    ),
)
async def edit_clutch(of: responses.ChangeOf) -> Response:
    """Edit a clutch's record (each field in the request replaces the whole field), archive the clutch or bring it
    back. Results are computed again.
    """
    fields, by = await responses.sent(of.request, ClutchEdit), auth.grant_of(of.request).name
    change = partial(edit, archived=fields.archived, reason=fields.reason, by=by, at=responses.now())
    await responses.changed(of, change, fields.fields())
    return responses.json_answer(await run_in_threadpool(clutch_list.look_up, of.database, of.clutch_id))


@router.get("/{clutch_id}/changes", response_model=ChangePage, responses=READING)
async def list_changes(of: responses.PageOf) -> Response:
    """The audit trail of the clutch and its runs: who changed what, when and why, newest first."""
    return await responses.clutch_answer(of, runs.trail, of.part)


@fleet_router.get("/priors", response_model=FleetPriorPage, responses=READING)
async def priors(request: Request, context: auth.Reader, part: responses.WholePaged) -> Response:
    """The priors learned from the clutches of each kind."""
    return await responses.answer(request, fleet_priors.page, context.database, part)


@fleet_router.get("/scores", response_model=FleetScores, responses=READING)
async def fleet_scores(request: Request, context: auth.Reader, method: Method = "particle") -> Response:
    """Scores of the predictions of all ended lives."""
    scored = await responses.computed_of_each(request, context, Scores, scores.scores_of_clutch, method)
    return await responses.answer(request, scores.scores_of_fleet, scored, method=method)
