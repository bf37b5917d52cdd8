"""The CSV exports: every table of the API as rows for a spreadsheet."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.answers import (
    degradation,
    diagnoses,
    fleet_priors,
    inspections,
    remaining_life,
    runs,
    scores,
    series,
    stribeck,
)
from service.api.diagnosis import PlanOut
from service.api.fleet import FleetPriorPage, FleetScores, Scores
from service.api.inspection import InspectionPage
from service.api.life import Method, RemainingLife
from service.api.over_life import Degradation, LoopPage, SeriesPage, StribeckPage, Surfaces
from service.api.parameters import DiagnosisId, LifeNumber, Quantity, State, TrackedQuantity
from service.api.run import ChangePage, RunPage
from service.paging import Part
from service.web import responses
from service.web.auth import Reader
from service.web.context import AtCycles, Prefer, PressureBar
from service.web.problems import READING
from service.web.responses import ExportedTable
from storage.engine.database import Database

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["spreadsheets"], responses=READING)
fleet_router = APIRouter(prefix="/v1/fleet", tags=["spreadsheets"], responses=READING)

_RUNS = ExportedTable(RunPage, runs.rows, runs.COLUMNS)
_CHANGES = ExportedTable(ChangePage, runs.trail_rows, runs.TRAIL_COLUMNS)
_INSPECTIONS = ExportedTable(InspectionPage, inspections.rows, inspections.COLUMNS)
_PLAN = ExportedTable(PlanOut, diagnoses.plan_rows, diagnoses.PLAN_COLUMNS)
_REMAINING = ExportedTable(RemainingLife, remaining_life.rows, remaining_life.COLUMNS)
_DEGRADATION = ExportedTable(Degradation, degradation.rows, degradation.COLUMNS)
_STRIBECK = ExportedTable(StribeckPage, stribeck.rows, ("run_id", "cycles", "held_runs"))
_SURFACES = ExportedTable(Surfaces, stribeck.surface_rows, ("cycles", "pressure_bar"))
_SCORES = ExportedTable(Scores, scores.rows, ("end_of_life_cycles", "cycles"))
_LOOPS = ExportedTable(LoopPage, runs.loop_rows, (*runs.LOOP_COLUMNS, "held_runs"))
_SERIES = ExportedTable(SeriesPage, series.rows, series.COLUMNS)
_STAGES = ExportedTable(FleetScores, scores.stage_rows, ("share_of_life",))
_PRIORS = ExportedTable(FleetPriorPage, fleet_priors.rows, fleet_priors.COLUMNS)


def _receipts(database: Database, clutch_id: str, part: Part, state: str | None) -> RunPage:
    return RunPage.model_validate_json(runs.page_as_json(database, clutch_id, part, state))


@router.get("/runs.csv", response_class=Response)
async def list_runs_csv(of: responses.WholeOf, state: State = None) -> Response:
    """Receipts by cycles as CSV; warnings and fits are counted."""
    return await responses.clutch_table(of, _receipts, _RUNS, of.part, state)


@router.get("/changes.csv", response_class=Response)
async def list_changes_csv(of: responses.WholeOf) -> Response:
    """The audit trail as CSV, newest first; what changed is JSON."""
    return await responses.clutch_table(of, runs.trail, _CHANGES, of.part)


@router.get("/inspections.csv", response_class=Response)
async def list_inspections_csv(of: responses.WholeOf) -> Response:
    """Inspections by cycles as CSV; photographs are counted."""
    return await responses.table(
        of.request, lambda: _INSPECTIONS.page(inspections.page(of.database, of.clutch_id, of.part))
    )


@router.get("/diagnoses/{diagnosis_id}/plan.csv", response_class=Response)
async def diagnosis_plan_csv(of: responses.WholeOf, diagnosis_id: DiagnosisId) -> Response:
    """The tests that a diagnosis advises as CSV, one row per step."""
    return await responses.table(
        of.request, lambda: _PLAN.page(diagnoses.plan(of.database, of.clutch_id, diagnosis_id))
    )


@router.get("/remaining-useful-life.csv", response_class=Response)
async def remaining_useful_life_csv(
    of: responses.WholeOf,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
    prefer: Prefer = None,
) -> Response:
    """Quantiles of remaining and end-of-life cycles, one row each."""
    arguments = (method, pressure_bar, at_cycles)
    return await responses.computed_table(of, remaining_life.remaining_life, _REMAINING, *arguments, prefer=prefer)


@router.get("/degradation.csv", response_class=Response)
async def degradation_csv(
    of: responses.WholeOf,
    method: Method = "grid",
    quantity: TrackedQuantity = None,
    at_cycles: AtCycles = None,
    life: LifeNumber = None,
    prefer: Prefer = None,
) -> Response:
    """Coefficients of eq. 6, one row per quantity and pressure."""
    arguments = degradation.arguments(method, quantity, at_cycles, life)
    return await responses.computed_table(of, degradation.degradation, _DEGRADATION, *arguments, prefer=prefer)


@router.get("/stribeck.csv", response_class=Response)
async def stribeck_csv(of: responses.WholeOf, prefer: Prefer = None) -> Response:
    """The fits, one row per test and pressure; `limit` counts tests."""
    return await responses.computed_table(of.whole, stribeck.curves, _STRIBECK, of.part, prefer=prefer)


@router.get("/surfaces.csv", response_class=Response)
async def surfaces_csv(of: responses.WholeOf, prefer: Prefer = None) -> Response:
    """The surfaces, one row per count of cycles, pressure and speed."""
    return await responses.computed_table(of, stribeck.surface, _SURFACES, prefer=prefer)


@router.get("/scores.csv", response_class=Response)
async def clutch_scores_csv(of: responses.WholeOf, method: Method = "particle", prefer: Prefer = None) -> Response:
    """The scored predictions, one row each."""
    return await responses.computed_table(of, scores.scores_of_clutch, _SCORES, method, prefer=prefer)


@router.get("/loops.csv", response_class=Response)
async def loops_csv(of: responses.WholeOf) -> Response:
    """Friction loops, one row each."""
    return await responses.clutch_table(of, runs.loops, _LOOPS, of.part)


@router.get("/series.csv", response_class=Response)
async def series_csv(of: responses.WholeOf, quantity: Quantity = None) -> Response:
    """The flat rows as CSV."""
    return await responses.clutch_table(of, series.series, _SERIES, of.part, quantity)


@fleet_router.get("/scores.csv", response_class=Response)
async def fleet_scores_csv(
    request: Request, context: Reader, part: responses.WholePaged, method: Method = "particle"
) -> Response:
    """Scores of all predictions, one row per stage of life; the last row has all."""
    scored = await responses.computed_of_each(request, context, Scores, scores.scores_of_clutch, method)
    return await responses.table(request, lambda: _STAGES.page(scores.scores_of_fleet(scored, method=method), part))


@fleet_router.get("/priors.csv", response_class=Response)
async def priors_csv(request: Request, context: Reader, part: responses.WholePaged) -> Response:
    """The fleet's priors, one row each."""
    return await responses.table(request, lambda: _PRIORS.page(fleet_priors.page(context.database, part)))
