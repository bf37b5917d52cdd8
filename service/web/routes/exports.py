"""The CSV exports: every table of the API as rows for a spreadsheet."""

from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request
from fastapi.responses import Response

from service.lists import ALL_ITEMS, from_cursor, to_cursor
from service.queries import (
    degradation,
    diagnoses,
    fleet_priors,
    inspections,
    remaining_life,
    runs,
    scores,
    series,
    stribeck,
    surfaces,
)
from service.schemas.curves import LoopItem, SeriesItem
from service.schemas.life import Method
from service.schemas.parameters import DiagnosisId, LifeNumber, Quantity, State, TrackedQuantity
from service.web.answers import (
    RowsAndNext,
    TablePage,
    clutch_table,
    computed_of_each,
    computed_table,
    sliced_rows,
    table,
    table_page,
)
from service.web.auth import Reader
from service.web.context import AtCycles, Cursor, Prefer, PressureBar, Whole
from service.web.problems import READING

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["spreadsheets"], responses=READING)
fleet_router = APIRouter(prefix="/v1/fleet", tags=["spreadsheets"], responses=READING)

OfTable = Annotated[TablePage, Depends(table_page)]


def _items(payload: Mapping[str, Any]) -> Any:
    return payload["items"]


@router.get("/runs.csv", response_class=Response)
async def list_runs_csv(of: OfTable, state: State = None) -> Response:
    """Receipts by cycles as CSV; warnings and fits are counted."""
    return await clutch_table(
        of,
        "runs",
        lambda: runs.rows(of.context.database, of.clutch_id, limit=of.limit, after=of.after, state=state),
        runs.COLUMNS,
        state,
    )


@router.get("/changes.csv", response_class=Response)
async def list_changes_csv(of: OfTable) -> Response:
    """The audit trail as CSV, newest first; what changed is JSON."""

    def make() -> RowsAndNext:
        items, place = runs.trail(of.context.database, of.clutch_id, limit=of.limit, after=of.after)
        return runs.trail_rows(items), to_cursor(place)

    return await clutch_table(of, "changes", make, runs.TRAIL_COLUMNS)


@router.get("/inspections.csv", response_class=Response)
async def list_inspections_csv(of: OfTable) -> Response:
    """Inspections by cycles as CSV; photographs are counted."""

    def make() -> RowsAndNext:
        items, place = inspections.page(of.context.database, of.clutch_id, limit=of.limit, after=of.after)
        return inspections.rows(items), to_cursor(place)

    return await table(of.request, inspections.COLUMNS, make)


@router.get("/diagnoses/{diagnosis_id}/plan.csv", response_class=Response)
async def diagnosis_plan_csv(of: OfTable, diagnosis_id: DiagnosisId) -> Response:
    """The tests that a diagnosis advises as CSV, a row a step."""

    def make() -> RowsAndNext:
        return diagnoses.plan_rows(diagnoses.plan(of.context.database, of.clutch_id, diagnosis_id)), None

    return await table(of.request, diagnoses.PLAN_COLUMNS, make)


@router.get("/remaining-useful-life.csv", response_class=Response)
async def remaining_useful_life_csv(
    of: OfTable,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
    prefer: Prefer = None,
) -> Response:
    """Quantiles of remaining and end-of-life cycles, a row each."""
    query, arguments = remaining_life.remaining_life, (method, pressure_bar, at_cycles)
    return await computed_table(of, query, remaining_life.rows, remaining_life.COLUMNS, *arguments, prefer=prefer)


@router.get("/degradation.csv", response_class=Response)
async def degradation_csv(
    of: OfTable,
    method: Method = "grid",
    quantity: TrackedQuantity = None,
    at_cycles: AtCycles = None,
    life: LifeNumber = None,
    prefer: Prefer = None,
) -> Response:
    """Eq. 6's coefficients, a row a quantity and pressure."""
    query, arguments = degradation.degradation, degradation.arguments(method, quantity, at_cycles, life)
    return await computed_table(of, query, degradation.rows, degradation.COLUMNS, *arguments, prefer=prefer)


@router.get("/stribeck.csv", response_class=Response)
async def stribeck_csv(of: OfTable, prefer: Prefer = None) -> Response:
    """The fits, a row a test and pressure; `limit` counts tests."""
    return await computed_table(
        of, stribeck.curves, lambda payload: stribeck.rows(_items(payload)), ("run_id", "cycles"), prefer=prefer,
        paged_by_query=True,
    )  # fmt: skip


@router.get("/surfaces.csv", response_class=Response)
async def surfaces_csv(of: OfTable, prefer: Prefer = None) -> Response:
    """The surfaces, a row a count of cycles, a pressure and a speed."""
    return await computed_table(of, surfaces.surface, surfaces.rows, ("cycles", "pressure_bar"), prefer=prefer)


@router.get("/scores.csv", response_class=Response)
async def clutch_scores_csv(of: OfTable, method: Method = "particle", prefer: Prefer = None) -> Response:
    """The scored predictions, a row each."""
    columns = ("end_of_life_cycles", "cycles")
    return await computed_table(
        of, scores.of_clutch, lambda payload: scores.rows(_items(payload)), columns, method, prefer=prefer
    )


@router.get("/loops.csv", response_class=Response)
async def loops_csv(of: OfTable) -> Response:
    """Friction loops, a row each."""

    def make() -> RowsAndNext:
        return sliced_rows(runs.loops(of.context.database, of.clutch_id), of.limit, of.after)

    return await clutch_table(of, "loops", make, tuple(LoopItem.model_fields))


@router.get("/series.csv", response_class=Response)
async def series_csv(of: OfTable, quantity: Quantity = None) -> Response:
    """The flat rows as CSV."""

    def make() -> RowsAndNext:
        return sliced_rows(series.series(of.context.database, of.clutch_id, quantity), of.limit, of.after)

    return await clutch_table(of, "series", make, tuple(SeriesItem.model_fields), quantity)


@fleet_router.get("/scores.csv", response_class=Response)
async def fleet_scores_csv(
    request: Request, context: Reader, method: Method = "particle", limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """How right the predictions of all were, a row a stage of life, the last one all of them."""
    after = from_cursor(cursor)
    scored = await computed_of_each(request, context, scores.of_clutch, method)

    def make() -> RowsAndNext:
        payload = scores.of_fleet(scored, method=method)
        return sliced_rows([*payload["stages"], {"share_of_life": None} | payload["overall"]], limit, after)

    return await table(request, ("share_of_life",), make)


@fleet_router.get("/priors.csv", response_class=Response)
async def priors_csv(request: Request, context: Reader, limit: Whole = ALL_ITEMS, cursor: Cursor = None) -> Response:
    """The fleet's priors, a row each."""
    after = from_cursor(cursor)

    def make() -> RowsAndNext:
        return sliced_rows(fleet_priors.rows(fleet_priors.newest(context.database)), limit, after)

    return await table(request, fleet_priors.COLUMNS, make)
