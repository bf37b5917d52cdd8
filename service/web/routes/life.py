"""The routes of remaining life, degradation, Stribeck curves, loops and series."""

import asyncio

from fastapi import APIRouter
from fastapi.responses import Response

from service.answers import runs, scores
from service.answers import series as series_answers
from service.answers import stribeck as stribeck_answers
from service.answers.degradation import arguments as degradation_arguments
from service.answers.degradation import degradation as degradation_of
from service.answers.engagement import engaged
from service.answers.planned_duty import planned_life
from service.answers.remaining_life import NO_CRITERIA, criteria_of, life_by_criteria, remaining_life
from service.api.fleet import Scores
from service.api.life import Method, PlannedLife, ProgrammeIn, RemainingLife
from service.api.over_life import Degradation, EngagementOut, LoopPage, SeriesPage, StribeckPage, Surfaces
from service.api.parameters import Draws, EngagementRun, LifeNumber, Quantity, TrackedQuantity
from service.clutch.tracking import PREDICTED
from service.jobs.workers import Lane
from service.web import responses
from service.web.context import AtCycles, Prefer, PressureBar, Until
from service.web.problems import READING

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["remaining life"])


@router.get("/remaining-useful-life", response_model=RemainingLife, responses=READING)
async def remaining_useful_life(
    of: responses.Of,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
    quantity: TrackedQuantity = None,
    criterion: TrackedQuantity = None,
    life: LifeNumber = None,
    prefer: Prefer = None,
) -> Response:
    """The remaining duty cycles until the first of the clutch's criteria is reached, with their uncertainty. The
    default criterion is a fraction of mean COF.
    """
    own = await responses.clutch_bytes(of, criteria_of)
    if own != NO_CRITERIA or (quantity, criterion, life) != (None, None, None):
        arguments = (method, pressure_bar, at_cycles, quantity, criterion, life)
        return await responses.computed_answer(of, life_by_criteria, *arguments, prefer=prefer)
    if method not in PREDICTED or pressure_bar is not None:
        return await responses.computed_answer(of, remaining_life, method, pressure_bar, at_cycles, prefer=prefer)
    return await responses.clutch_answer(of, remaining_life, method, None, at_cycles)


@router.post(
    "/remaining-useful-life/forecast",
    **responses.taking(
        ProgrammeIn,
        PlannedLife,
        {
            "programme": [
                {"cycles": 5000, "energy_per_cycle_kj": 25, "sd": 2},
                {"cycles": 1000, "initial_speed_rpm": 3000, "maximum_pressure_bar": 10},
            ],
            "pace_cycles_per_hour": 120,
        },
    ),
)
async def planned_remaining_life(of: responses.Of, method: Method = "particle") -> Response:
    """Remaining life under planned duty: blocks that are repeated until the end of life. Nothing is stored."""
    planned = await responses.sent(of.request, ProgrammeIn)
    answer = of.context.workers.submit(Lane.SIMULATIONS, planned_life, of.clutch_id, method, planned)
    return responses.json_answer(await asyncio.wrap_future(answer))


@router.get("/degradation", response_model=Degradation, responses=READING)
async def degradation(
    of: responses.WholeOf,
    method: Method = "grid",
    quantity: TrackedQuantity = None,
    at_cycles: AtCycles = None,
    life: LifeNumber = None,
    draws: Draws = 0,
    until: Until = None,
    prefer: Prefer = None,
) -> Response:
    """Tracks of a life by any filter: coefficients of eq. 6, measurements, trajectory with its 90 % band. For one
    quantity, or for mean COF and every Stribeck parameter.
    """
    arguments = degradation_arguments(method, quantity, at_cycles, life, draws, until)
    return await responses.computed_answer(of, degradation_of, *arguments, prefer=prefer)


@router.get("/stribeck", response_model=StribeckPage, responses=READING)
async def stribeck(of: responses.PageOf, prefer: Prefer = None) -> Response:
    """The Stribeck curves of the stationary tests by cycles, and the pressure laws through them (fig. 9)."""
    return await responses.computed_answer(of.whole, stribeck_answers.curves, of.part, prefer=prefer)


@router.get("/engagement", response_model=EngagementOut, responses=READING)
async def engagement(
    of: responses.Of, at_cycles: AtCycles = None, run_id: EngagementRun = None, prefer: Prefer = None
) -> Response:
    """A simulated engagement of the tracked clutch (pressure of fig. 3, motor of 20 Nm), the indicators of measured
    engagements, and one of these beside the tracked model.
    """
    return await responses.computed_answer(of, engaged, at_cycles, run_id, prefer=prefer, lane=Lane.SIMULATIONS)


@router.get("/surfaces", response_model=Surfaces, responses=READING)
async def surfaces(of: responses.Of, prefer: Prefer = None) -> Response:
    """The tracked Stribeck parameters over pressure and cycles (figs. 10, 11), and torque over speed."""
    return await responses.computed_answer(of, stribeck_answers.surface, prefer=prefer)


@router.get("/scores", response_model=Scores, responses=READING)
async def clutch_scores(of: responses.WholeOf, method: Method = "particle", prefer: Prefer = None) -> Response:
    """Scores of the predictions of its ended lives."""
    return await responses.computed_answer(of, scores.scores_of_clutch, method, prefer=prefer)


@router.get("/loops", response_model=LoopPage, responses=READING)
async def loops(of: responses.WholeOf) -> Response:
    """Friction loops of the dynamic tests by cycles and pressure."""
    return await responses.clutch_answer(of, runs.loops, of.part)


@router.get("/series", response_model=SeriesPage, responses=READING)
async def series(of: responses.WholeOf, quantity: Quantity = None) -> Response:
    """Flat rows for dashboards and spreadsheets: fitted quantities, indicators of engagements, then predictions."""
    return await responses.clutch_answer(of, series_answers.series, of.part, quantity)
