"""Remaining useful life, degradation, Stribeck curves, loops and flat series."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.queries import runs, scores
from service.queries import series as series_query
from service.queries import stribeck as stribeck_query
from service.queries.degradation import degradation as degradation_of
from service.queries.engagement import engaged
from service.queries.remaining_life import remaining_life
from service.queries.surfaces import surface
from service.schemas.curves import EngagementOut, LoopPage, SeriesPage, StribeckPage
from service.schemas.degradation import Degradation, Surfaces
from service.schemas.fleet import Scores
from service.schemas.life import Method, RemainingLife
from service.schemas.parameters import ClutchId, Quantity
from service.web.answers import clutch_answer, clutch_list_answer, from_cursor, page
from service.web.auth import Reader
from service.web.context import AtCycles, Cursor, Limit, PressureBar, Whole
from service.web.limits import ALL_ITEMS, USUAL_ITEMS
from service.web.problems import READING

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["remaining life"])


@router.get("/remaining-useful-life", response_model=RemainingLife, responses=READING)
def remaining_useful_life(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
) -> Response:
    """The duty cycles that remain until mean COF has fallen to the criterion's fraction, with their uncertainty."""

    def make() -> object:
        return remaining_life(
            context.database, clutch_id, method=method, pressure_bar=pressure_bar, at_cycles=at_cycles
        )

    return clutch_answer(request, context, clutch_id, "remaining-useful-life", make, method, pressure_bar, at_cycles)


@router.get("/degradation", response_model=Degradation, responses=READING)
def degradation(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """Eq. 6 for every Stribeck parameter and for mean COF: coefficients, measurements, trajectory with its 90 % band."""
    return clutch_list_answer(
        request, context, clutch_id, "degradation", lambda: degradation_of(context.database, clutch_id), limit, cursor
    )


@router.get("/stribeck", response_model=StribeckPage, responses=READING)
def stribeck(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = USUAL_ITEMS, cursor: Cursor = None
) -> Response:
    """The Stribeck curves of the stationary tests by cycles, and the pressure laws through them (fig. 9)."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*stribeck_query.page(context.database, clutch_id, limit=limit, after=after))

    return clutch_answer(request, context, clutch_id, "stribeck", make, limit, after)


@router.get("/engagement", response_model=EngagementOut, responses=READING)
def engagement(request: Request, context: Reader, clutch_id: ClutchId, at_cycles: AtCycles = None) -> Response:
    """A simulated engagement of the tracked clutch: the pressure profile of fig. 3 against the motor's 20 Nm."""
    return clutch_answer(
        request,
        context,
        clutch_id,
        "engagement",
        lambda: engaged(context.database, clutch_id, at_cycles=at_cycles),
        at_cycles,
    )


@router.get("/surfaces", response_model=Surfaces, responses=READING)
def surfaces(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """The tracked Stribeck parameters over pressure and cycles (figs. 10, 11), and torque over speed besides."""
    return clutch_answer(request, context, clutch_id, "surfaces", lambda: surface(context.database, clutch_id))


@router.get("/scores", response_model=Scores, responses=READING)
def clutch_scores(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """How right the predictions were of those of its lives that came to their end."""

    def make() -> dict[str, object]:
        return scores.of_clutch(context.database, clutch_id, method=method)

    return clutch_list_answer(request, context, clutch_id, "scores", make, limit, cursor, method)


@router.get("/loops", response_model=LoopPage, responses=READING)
def loops(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """Friction loops of the dynamic tests by cycles and pressure."""

    def make() -> dict[str, object]:
        return page(runs.loops(context.database, clutch_id), None)

    return clutch_list_answer(request, context, clutch_id, "loops", make, limit, cursor)


@router.get("/series", response_model=SeriesPage, responses=READING)
def series(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    quantity: Quantity = None,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """Flat rows for dashboards and spreadsheets: every fitted quantity, then the predictions."""

    def make() -> dict[str, object]:
        return page(series_query.series(context.database, clutch_id, quantity), None)

    return clutch_list_answer(request, context, clutch_id, "series", make, limit, cursor, quantity)
