"""The CSV exports: every table of the API as rows for a spreadsheet."""

from collections.abc import Mapping
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.queries import degradation, fleet_priors, remaining_life, runs, scores, series, stribeck, surfaces
from service.schemas.curves import LoopItem, SeriesItem
from service.schemas.life import Method
from service.schemas.parameters import ClutchId, Quantity, State
from service.web.answers import clutch_table, from_cursor, page, table
from service.web.auth import Reader
from service.web.context import AtCycles, Cursor, Limit, PressureBar
from service.web.limits import MOST_ITEMS
from service.web.problems import READING

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["spreadsheets"])
fleet_router = APIRouter(prefix="/v1/fleet", tags=["spreadsheets"])


def _items(payload: Mapping[str, Any]) -> Any:
    return payload["items"]


@router.get("/runs.csv", response_class=Response, responses=READING)
def list_runs_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    state: State = None,
    limit: Limit = MOST_ITEMS,
    cursor: Cursor = None,
) -> Response:
    """Receipts by cycles as CSV; warnings and fits are counted."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*runs.page(context.database, clutch_id, limit=limit, after=after, state=state))

    return clutch_table(
        request,
        context,
        clutch_id,
        "runs",
        make,
        lambda payload: runs.rows(_items(payload)),
        runs.COLUMNS,
        state,
        limit,
        after,
    )


@router.get("/changes.csv", response_class=Response, responses=READING)
def list_changes_csv(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = MOST_ITEMS, cursor: Cursor = None
) -> Response:
    """The audit trail as CSV, newest first; what changed is JSON."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*runs.trail(context.database, clutch_id, limit=limit, after=after))

    return clutch_table(
        request, context, clutch_id, "changes", make, lambda payload: runs.trail_rows(_items(payload)),
        runs.TRAIL_COLUMNS, limit, after,
    )  # fmt: skip


@router.get("/remaining-useful-life.csv", response_class=Response, responses=READING)
def remaining_useful_life_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
) -> Response:
    """Quantiles of remaining and end-of-life cycles, a row each."""

    def make() -> object:
        return remaining_life.remaining_life(
            context.database, clutch_id, method=method, pressure_bar=pressure_bar, at_cycles=at_cycles
        )

    return clutch_table(
        request, context, clutch_id, "remaining-useful-life", make, remaining_life.rows, remaining_life.COLUMNS,
        method, pressure_bar, at_cycles,
    )  # fmt: skip


@router.get("/degradation.csv", response_class=Response, responses=READING)
def degradation_csv(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """Eq. 6's coefficients, a row a quantity and pressure."""

    def make() -> object:
        return degradation.degradation(context.database, clutch_id)

    return clutch_table(request, context, clutch_id, "degradation", make, degradation.rows, degradation.COLUMNS)


@router.get("/stribeck.csv", response_class=Response, responses=READING)
def stribeck_csv(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = MOST_ITEMS, cursor: Cursor = None
) -> Response:
    """The fits, a row a test and pressure."""
    after = from_cursor(cursor)

    def make() -> object:
        return page(*stribeck.page(context.database, clutch_id, limit=limit, after=after))

    return clutch_table(
        request, context, clutch_id, "stribeck", make, lambda payload: stribeck.rows(_items(payload)),
        ("run_id", "cycles"), limit, after,
    )  # fmt: skip


@router.get("/surfaces.csv", response_class=Response, responses=READING)
def surfaces_csv(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """The surfaces, a row a count of cycles, a pressure and a speed."""

    def make() -> object:
        return surfaces.surface(context.database, clutch_id)

    return clutch_table(request, context, clutch_id, "surfaces", make, surfaces.rows, ("cycles", "pressure_bar"))


@router.get("/scores.csv", response_class=Response, responses=READING)
def clutch_scores_csv(request: Request, context: Reader, clutch_id: ClutchId, method: Method = "particle") -> Response:
    """The scored predictions, a row each."""

    def make() -> object:
        return scores.of_clutch(context.database, clutch_id, method=method)

    return clutch_table(
        request, context, clutch_id, "scores", make, lambda payload: scores.rows(_items(payload)),
        ("end_of_life_cycles", "cycles"), method,
    )  # fmt: skip


@router.get("/loops.csv", response_class=Response, responses=READING)
def loops_csv(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """Friction loops, a row each."""

    def make() -> object:
        return page(runs.loops(context.database, clutch_id), None)

    return clutch_table(request, context, clutch_id, "loops", make, _items, tuple(LoopItem.model_fields))


@router.get("/series.csv", response_class=Response, responses=READING)
def series_csv(request: Request, context: Reader, clutch_id: ClutchId, quantity: Quantity = None) -> Response:
    """The flat rows as CSV."""

    def make() -> object:
        return page(series.series(context.database, clutch_id, quantity), None)

    return clutch_table(request, context, clutch_id, "series", make, _items, tuple(SeriesItem.model_fields), quantity)


@fleet_router.get("/scores.csv", response_class=Response, responses=READING)
def fleet_scores_csv(request: Request, context: Reader, method: Method = "particle") -> Response:
    """How right the predictions of all were, a row a stage of life, the last one all of them."""
    payload = scores.of_fleet(context.database, context.cache, method=method)
    stages = [*payload["stages"], {"share_of_life": None} | payload["overall"]]
    return table(request, tuple(stages[0]), stages)


@fleet_router.get("/priors.csv", response_class=Response, responses=READING)
def priors_csv(request: Request, context: Reader) -> Response:
    """The fleet's priors, a row each."""
    return table(request, fleet_priors.COLUMNS, fleet_priors.rows(fleet_priors.newest(context.database)))
