"""The CSV exports: every table of the API as rows for a spreadsheet."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.lists import ALL_ITEMS, from_cursor, to_cursor
from service.queries import degradation, fleet_priors, inspections, runs, scores, series, stribeck, surfaces
from service.queries.life import remaining_life
from service.schemas.curves import LoopItem, SeriesItem
from service.schemas.parameters import ClutchId, LifeNumber, Quantity, State, TrackedQuantity
from service.schemas.prognosis.life import Method
from service.web.answers import clutch_table, computed_of_each, computed_table, table
from service.web.auth import Reader
from service.web.context import AtCycles, Cursor, Prefer, PressureBar, Whole
from service.web.problems import READING
from service.web.tables import RowsAndNext, sliced_rows

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["spreadsheets"])
fleet_router = APIRouter(prefix="/v1/fleet", tags=["spreadsheets"])


def _items(payload: Mapping[str, Any]) -> Any:
    return payload["items"]


@router.get("/runs.csv", response_class=Response, responses=READING)
async def list_runs_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    state: State = None,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """Receipts by cycles as CSV; warnings and fits are counted."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        return runs.rows(context.database, clutch_id, limit=limit, after=after, state=state)

    return await clutch_table(request, context, clutch_id, "runs", make, runs.COLUMNS, state, limit, after)


@router.get("/changes.csv", response_class=Response, responses=READING)
async def list_changes_csv(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """The audit trail as CSV, newest first; what changed is JSON."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        items, place = runs.trail(context.database, clutch_id, limit=limit, after=after)
        return runs.trail_rows(items), to_cursor(place)

    return await clutch_table(request, context, clutch_id, "changes", make, runs.TRAIL_COLUMNS, limit, after)


@router.get("/inspections.csv", response_class=Response, responses=READING)
async def list_inspections_csv(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """Inspections by cycles as CSV; photographs are counted."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        items, place = inspections.page(context.database, clutch_id, limit=limit, after=after)
        return inspections.rows(items), to_cursor(place)

    return await table(request, inspections.COLUMNS, make)


@router.get("/remaining-useful-life.csv", response_class=Response, responses=READING)
async def remaining_useful_life_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
    prefer: Prefer = None,
) -> Response:
    """Quantiles of remaining and end-of-life cycles, a row each."""

    return await computed_table(
        request, context, clutch_id, remaining_life.remaining_life, remaining_life.rows, remaining_life.COLUMNS,
        method, pressure_bar, at_cycles, limit=limit, cursor=cursor, prefer=prefer,
    )  # fmt: skip


@router.get("/degradation.csv", response_class=Response, responses=READING)
async def degradation_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "grid",
    quantity: TrackedQuantity = None,
    at_cycles: AtCycles = None,
    life: LifeNumber = None,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
    prefer: Prefer = None,
) -> Response:
    """Eq. 6's coefficients, a row a quantity and pressure."""
    arguments = degradation.arguments(method, quantity, at_cycles, life)
    return await computed_table(
        request, context, clutch_id, degradation.degradation, degradation.rows, degradation.COLUMNS, *arguments,
        limit=limit, cursor=cursor, prefer=prefer,
    )  # fmt: skip


@router.get("/stribeck.csv", response_class=Response, responses=READING)
async def stribeck_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
    prefer: Prefer = None,
) -> Response:
    """The fits, a row a test and pressure; `limit` counts tests."""
    return await computed_table(
        request, context, clutch_id, stribeck.curves, lambda payload: stribeck.rows(_items(payload)),
        ("run_id", "cycles"), limit, from_cursor(cursor), prefer=prefer,
    )  # fmt: skip


@router.get("/surfaces.csv", response_class=Response, responses=READING)
async def surfaces_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
    prefer: Prefer = None,
) -> Response:
    """The surfaces, a row a count of cycles, a pressure and a speed."""
    return await computed_table(
        request, context, clutch_id, surfaces.surface, surfaces.rows, ("cycles", "pressure_bar"),
        limit=limit, cursor=cursor, prefer=prefer,
    )  # fmt: skip


@router.get("/scores.csv", response_class=Response, responses=READING)
async def clutch_scores_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
    prefer: Prefer = None,
) -> Response:
    """The scored predictions, a row each."""
    return await computed_table(
        request, context, clutch_id, scores.of_clutch, lambda payload: scores.rows(_items(payload)),
        ("end_of_life_cycles", "cycles"), method, limit=limit, cursor=cursor, prefer=prefer,
    )  # fmt: skip


@router.get("/loops.csv", response_class=Response, responses=READING)
async def loops_csv(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """Friction loops, a row each."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        return sliced_rows(runs.loops(context.database, clutch_id), limit, after)

    return await clutch_table(request, context, clutch_id, "loops", make, tuple(LoopItem.model_fields), limit, after)


@router.get("/series.csv", response_class=Response, responses=READING)
async def series_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    quantity: Quantity = None,
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """The flat rows as CSV."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        return sliced_rows(series.series(context.database, clutch_id, quantity), limit, after)

    columns = tuple(SeriesItem.model_fields)
    return await clutch_table(request, context, clutch_id, "series", make, columns, quantity, limit, after)


@fleet_router.get("/scores.csv", response_class=Response, responses=READING)
async def fleet_scores_csv(
    request: Request,
    context: Reader,
    method: Method = "particle",
    limit: Whole = ALL_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """How right the predictions of all were, a row a stage of life, the last one all of them."""
    after = from_cursor(cursor)
    scored = await computed_of_each(request, context, scores.of_clutch, method)

    def make() -> RowsAndNext:
        payload = scores.of_fleet(scored, method=method)
        return sliced_rows([*payload["stages"], {"share_of_life": None} | payload["overall"]], limit, after)

    return await table(request, ("share_of_life",), make)


@fleet_router.get("/priors.csv", response_class=Response, responses=READING)
async def priors_csv(request: Request, context: Reader, limit: Whole = ALL_ITEMS, cursor: Cursor = None) -> Response:
    """The fleet's priors, a row each."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        return sliced_rows(fleet_priors.rows(fleet_priors.newest(context.database)), limit, after)

    return await table(request, fleet_priors.COLUMNS, make)
