"""The CSV exports: every table of the API as rows for a spreadsheet."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request
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
from service.schemas.life import Method
from service.schemas.over_life import LoopItem, SeriesItem
from service.schemas.parameters import DiagnosisId, LifeNumber, Quantity, State, TrackedQuantity
from service.web import answers
from service.web.auth import Reader
from service.web.context import AtCycles, Cursor, Prefer, PressureBar, Whole
from service.web.problems import READING

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["spreadsheets"], responses=READING)
fleet_router = APIRouter(prefix="/v1/fleet", tags=["spreadsheets"], responses=READING)


def _items(payload: Mapping[str, Any]) -> Any:
    return payload["items"]


@router.get("/runs.csv", response_class=Response)
async def list_runs_csv(of: answers.WholeOf, state: State = None) -> Response:
    """Receipts by cycles as CSV; warnings and fits are counted."""
    return await answers.clutch_table(
        of,
        "runs",
        lambda: runs.rows(of.database, of.clutch_id, limit=of.limit, after=of.after, state=state),
        runs.COLUMNS,
        state,
    )


@router.get("/changes.csv", response_class=Response)
async def list_changes_csv(of: answers.WholeOf) -> Response:
    """The audit trail as CSV, newest first; what changed is JSON."""

    def make() -> answers.RowsAndNext:
        items, place = runs.trail(of.database, of.clutch_id, limit=of.limit, after=of.after)
        return runs.trail_rows(items), to_cursor(place)

    return await answers.clutch_table(of, "changes", make, runs.TRAIL_COLUMNS)


@router.get("/inspections.csv", response_class=Response)
async def list_inspections_csv(of: answers.WholeOf) -> Response:
    """Inspections by cycles as CSV; photographs are counted."""

    def make() -> answers.RowsAndNext:
        items, place = inspections.page(of.database, of.clutch_id, limit=of.limit, after=of.after)
        return inspections.rows(items), to_cursor(place)

    return await answers.table(of.request, inspections.COLUMNS, make)


@router.get("/diagnoses/{diagnosis_id}/plan.csv", response_class=Response)
async def diagnosis_plan_csv(of: answers.WholeOf, diagnosis_id: DiagnosisId) -> Response:
    """The tests that a diagnosis advises as CSV, one row per step."""
    return await answers.table(
        of.request,
        diagnoses.PLAN_COLUMNS,
        lambda: (diagnoses.plan_rows(diagnoses.plan(of.database, of.clutch_id, diagnosis_id)), None),
    )


@router.get("/remaining-useful-life.csv", response_class=Response)
async def remaining_useful_life_csv(
    of: answers.WholeOf,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
    prefer: Prefer = None,
) -> Response:
    """Quantiles of remaining and end-of-life cycles, one row each."""
    query, arguments = remaining_life.remaining_life, (method, pressure_bar, at_cycles)
    return await answers.computed_table(
        of, query, remaining_life.rows, remaining_life.COLUMNS, *arguments, prefer=prefer
    )


@router.get("/degradation.csv", response_class=Response)
async def degradation_csv(
    of: answers.WholeOf,
    method: Method = "grid",
    quantity: TrackedQuantity = None,
    at_cycles: AtCycles = None,
    life: LifeNumber = None,
    prefer: Prefer = None,
) -> Response:
    """Coefficients of eq. 6, one row per quantity and pressure."""
    query, arguments = degradation.degradation, degradation.arguments(method, quantity, at_cycles, life)
    return await answers.computed_table(of, query, degradation.rows, degradation.COLUMNS, *arguments, prefer=prefer)


@router.get("/stribeck.csv", response_class=Response)
async def stribeck_csv(of: answers.WholeOf, prefer: Prefer = None) -> Response:
    """The fits, one row per test and pressure; `limit` counts tests."""
    return await answers.computed_table(
        of, stribeck.curves, stribeck.rows, ("run_id", "cycles", "held_runs"), prefer=prefer,
        paged_by_query=True,
    )  # fmt: skip


@router.get("/surfaces.csv", response_class=Response)
async def surfaces_csv(of: answers.WholeOf, prefer: Prefer = None) -> Response:
    """The surfaces, one row per count of cycles, pressure and speed."""
    return await answers.computed_table(of, surfaces.surface, surfaces.rows, ("cycles", "pressure_bar"), prefer=prefer)


@router.get("/scores.csv", response_class=Response)
async def clutch_scores_csv(of: answers.WholeOf, method: Method = "particle", prefer: Prefer = None) -> Response:
    """The scored predictions, one row each."""
    columns = ("end_of_life_cycles", "cycles")
    return await answers.computed_table(
        of, scores.of_clutch, lambda payload: scores.rows(_items(payload)), columns, method, prefer=prefer
    )


@router.get("/loops.csv", response_class=Response)
async def loops_csv(of: answers.WholeOf) -> Response:
    """Friction loops, one row each."""

    def make() -> answers.RowsAndNext:
        found, held = runs.loops(of.database, of.clutch_id)
        return answers.sliced_rows([loop | {"held_runs": held} for loop in found], of.limit, of.after)

    return await answers.clutch_table(of, "loops", make, (*LoopItem.model_fields, "held_runs"))


@router.get("/series.csv", response_class=Response)
async def series_csv(of: answers.WholeOf, quantity: Quantity = None) -> Response:
    """The flat rows as CSV."""
    return await answers.clutch_table(
        of,
        "series",
        lambda: answers.sliced_rows(series.series(of.database, of.clutch_id, quantity), of.limit, of.after),
        tuple(SeriesItem.model_fields),
        quantity,
    )


@fleet_router.get("/scores.csv", response_class=Response)
async def fleet_scores_csv(
    request: Request, context: Reader, method: Method = "particle", limit: Whole = ALL_ITEMS, cursor: Cursor = None
) -> Response:
    """Scores of all predictions, one row per stage of life; the last row has all."""
    after = from_cursor(cursor)
    scored = await answers.computed_of_each(request, context, scores.of_clutch, method)

    def make() -> answers.RowsAndNext:
        payload = scores.of_fleet(scored, method=method)
        return answers.sliced_rows([*payload["stages"], {"share_of_life": None} | payload["overall"]], limit, after)

    return await answers.table(request, ("share_of_life",), make)


@fleet_router.get("/priors.csv", response_class=Response)
async def priors_csv(request: Request, context: Reader, limit: Whole = ALL_ITEMS, cursor: Cursor = None) -> Response:
    """The fleet's priors, one row each."""
    after = from_cursor(cursor)
    return await answers.table(
        request,
        fleet_priors.COLUMNS,
        lambda: answers.sliced_rows(fleet_priors.rows(fleet_priors.newest(context.database)), limit, after),
    )
