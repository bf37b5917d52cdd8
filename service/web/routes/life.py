"""Remaining useful life, degradation, Stribeck curves, loops and flat series, each with its CSV twin."""

from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from service.queries import answers, scores
from service.queries.surfaces import flat as flat_surfaces
from service.schemas.curves import EngagementOut, LoopItem, LoopPage, SeriesItem, SeriesPage, StribeckPage
from service.schemas.degradation import Degradation, Surfaces
from service.schemas.fleet import Scores
from service.schemas.life import Method, RemainingLife
from service.schemas.parameters import ClutchId, Quantity
from service.web.context import AtCycles, Cursor, Limit, PressureBar, Reader, Whole
from service.web.lasting import lasting_answer, lasting_table
from service.web.pages import answer, from_cursor, page, sliced, table
from service.web.problems import READING
from storage.engine.database import Database

router = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["remaining life"])
twins = APIRouter(prefix="/v1/clutches/{clutch_id}", tags=["spreadsheets"])


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
    said = answers.remaining_life(
        context.database,
        context.remembered,
        clutch_id,
        method=method,
        pressure_bar=pressure_bar,
        at_cycles=at_cycles,
    )
    return answer(request, said)


@router.get("/degradation", response_model=Degradation, responses=READING)
def degradation(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = 1_000_000, cursor: Cursor = None
) -> Response:
    """Eq. 6 for every Stribeck parameter and for mean COF: coefficients, measurements, trajectory with its 90 % band."""
    after = from_cursor(cursor)

    def told() -> dict[str, Any]:
        said = answers.degradation(context.database, context.remembered, clutch_id)
        return said | sliced(said["items"], limit, after)

    return lasting_answer(request, context, clutch_id, told)


@router.get("/stribeck", response_model=StribeckPage, responses=READING)
def stribeck(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """The Stribeck curves of the stationary tests by cycles, and the pressure laws through them (fig. 9)."""
    after = from_cursor(cursor)

    def told() -> dict[str, Any]:
        return page(*answers.stribeck_page(context.database, context.remembered, clutch_id, limit=limit, after=after))

    return lasting_answer(request, context, clutch_id, told)


@router.get("/engagement", response_model=EngagementOut, responses=READING)
def engagement(request: Request, context: Reader, clutch_id: ClutchId, at_cycles: AtCycles = None) -> Response:
    """A simulated engagement of the tracked clutch: the pressure profile of fig. 3 against the motor's 20 Nm."""
    return answer(request, answers.engaged(context.database, context.remembered, clutch_id, at_cycles=at_cycles))


@router.get("/surfaces", response_model=Surfaces, responses=READING)
def surfaces(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """The tracked Stribeck parameters over pressure and cycles (figs. 10, 11), and torque over speed besides."""
    return lasting_answer(
        request, context, clutch_id, lambda: answers.surface(context.database, context.remembered, clutch_id)
    )


@router.get("/scores", response_model=Scores, responses=READING)
def clutch_scores(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    limit: Whole = 1_000_000,
    cursor: Cursor = None,
) -> Response:
    """How right the predictions were of those of its lives that came to their end."""
    said = scores.of_clutch(context.database, context.remembered, clutch_id, method=method)
    return answer(request, said | sliced(said["items"], limit, from_cursor(cursor)))


@router.get("/loops", response_model=LoopPage, responses=READING)
def loops(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Whole = 1_000_000, cursor: Cursor = None
) -> Response:
    """Friction loops of the dynamic tests by cycles and pressure."""
    after = from_cursor(cursor)
    return lasting_answer(
        request, context, clutch_id, lambda: sliced(answers.loop_page(context.database, clutch_id), limit, after)
    )


@router.get("/series", response_model=SeriesPage, responses=READING)
def series(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    quantity: Quantity = None,
    limit: Whole = 1_000_000,
    cursor: Cursor = None,
) -> Response:
    """Flat rows for dashboards and spreadsheets: every fitted quantity, then what was foretold."""
    after = from_cursor(cursor)
    return lasting_answer(
        request, context, clutch_id, lambda: sliced(_series(context.database, clutch_id, quantity), limit, after)
    )


def _series(database: Database, clutch_id: str, quantity: str | None) -> list[dict[str, Any]]:
    return [row for row in answers.series(database, clutch_id) if quantity in (None, row["quantity"])]


@twins.get("/remaining-useful-life.csv", response_class=Response, responses=READING)
def remaining_useful_life_csv(
    request: Request,
    context: Reader,
    clutch_id: ClutchId,
    method: Method = "particle",
    pressure_bar: PressureBar = None,
    at_cycles: AtCycles = None,
) -> Response:
    """Quantiles of remaining and end-of-life cycles, a row each."""
    said = answers.remaining_life(
        context.database,
        context.remembered,
        clutch_id,
        method=method,
        pressure_bar=pressure_bar,
        at_cycles=at_cycles,
    )
    kept = ("as_of_cycles", "status")
    rows = (
        {name: said[name] for name in kept}
        | {"quantile": quantile, "remaining_cycles": value, "end_of_life_cycles": said["end_of_life_cycles"][quantile]}
        for quantile, value in said["remaining_cycles"].items()
    )
    return table(request, (*kept, "quantile", "remaining_cycles", "end_of_life_cycles"), rows)


@twins.get("/degradation.csv", response_class=Response, responses=READING)
def degradation_csv(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """Eq. 6's coefficients, a row a quantity and pressure."""
    items = answers.degradation(context.database, context.remembered, clutch_id)["items"]
    names = ("initial", "change", "scale_cycles", "exponent")
    columns = ("quantity", "unit", "pressure_bar", *(f"{name}{part}" for name in names for part in ("", "_sd")))
    rows = (
        {name: item[name] for name in columns[:3]}
        | {name: item["coefficients"][name]["value"] for name in names}
        | {f"{name}_sd": item["coefficients"][name]["sd"] for name in names}
        for item in items
    )
    return table(request, columns, rows)


@twins.get("/stribeck.csv", response_class=Response, responses=READING)
def stribeck_csv(
    request: Request, context: Reader, clutch_id: ClutchId, limit: Limit = 1000, cursor: Cursor = None
) -> Response:
    """The fits, a row a test and pressure."""
    items, _ = answers.stribeck_page(
        context.database, context.remembered, clutch_id, limit=limit, after=from_cursor(cursor)
    )
    rows = [_fit_row(item, fit) for item in items for fit in item["fits"]]
    return table(request, tuple(rows[0]) if rows else ("run_id", "cycles"), rows)


def _fit_row(item: dict[str, Any], fit: dict[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {
        name: value for name, value in fit.items() if name not in ("parameters", "standard_errors", "undetermined")
    }
    errors = {f"{name}_se": value for name, value in fit["standard_errors"].items()}
    return {"run_id": item["run_id"], "cycles": item["cycles"], **flat, **fit["parameters"], **errors}


@twins.get("/surfaces.csv", response_class=Response, responses=READING)
def surfaces_csv(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """The surfaces, a row a count of cycles, a pressure and a speed."""
    rows = flat_surfaces(answers.surface(context.database, context.remembered, clutch_id))
    return table(request, tuple(rows[0]), rows)


@twins.get("/scores.csv", response_class=Response, responses=READING)
def clutch_scores_csv(request: Request, context: Reader, clutch_id: ClutchId, method: Method = "particle") -> Response:
    """The scored predictions, a row each."""
    items = scores.of_clutch(context.database, context.remembered, clutch_id, method=method)["items"]
    rows = [row for item in items for row in scores.flat(item)]
    return table(request, tuple(rows[0]) if rows else ("end_of_life_cycles", "cycles"), rows)


@twins.get("/loops.csv", response_class=Response, responses=READING)
def loops_csv(request: Request, context: Reader, clutch_id: ClutchId) -> Response:
    """Friction loops, a row each."""
    return table(request, tuple(LoopItem.model_fields), answers.loop_page(context.database, clutch_id))


@twins.get("/series.csv", response_class=Response, responses=READING)
def series_csv(request: Request, context: Reader, clutch_id: ClutchId, quantity: Quantity = None) -> Response:
    """The flat rows as CSV."""
    columns = tuple(SeriesItem.model_fields)
    return lasting_table(request, context, clutch_id, columns, lambda: _series(context.database, clutch_id, quantity))
