"""`/series`: flat rows for dashboards and spreadsheets, every fitted quantity and then the predictions.

Every row is stored or follows in closed form from a stored fit, as the slopes do: nothing is fitted or tracked here.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

from models.friction.criteria import Z90
from service import repository
from service.api.clutch import ClutchIn
from service.channels import bar, whole
from service.clutch.analysis import LevelFit
from service.clutch.assumptions import ALL_PRESSURES, MEAN_COF
from service.clutch.condition import SHOWN
from service.clutch.engagements import ALL_INDICATORS
from service.clutch.items import INSUFFICIENT, PARAMETER_UNITS
from service.clutch.quantities.measured import (
    LOOP_COLUMNS,
    QUANTITIES,
    SLOPE,
    SLOPE_SPEEDS,
    curves_of,
    rounded_frequency,
    slope_of,
)
from service.clutch.timeline import DYNAMIC, STATIONARY
from service.paging import Part
from storage import results, runs
from storage.engine.database import Database
from storage.results import PredictionRow
from storage.runs import RunRow

#: Over all pressures, and at no frequency or speed.
_NOWHERE = {"pressure_bar": None, "frequency_hz": None, "speed_rpm": None}


def series(database: Database, clutch_id: str, part: Part, quantity: str | None) -> dict[str, Any]:
    """Each quantity of each test by cycles, the slopes of its curves, those of each friction loop, the indicators of each
    engagement, then the remaining cycles as they were predicted, and how many runs are held; of one quantity, or of all.

    Raises NotFoundError.
    """
    with database.reading() as connection:
        clutch = repository.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, kind=STATIONARY, state=runs.ACCEPTED)
        levels = repository.levels(connection, clutch_id) if quantity in (None, SLOPE) else {}
        of_loops = quantity is None or quantity in LOOP_COLUMNS
        dynamic = runs.page(connection, clutch_id, kind=DYNAMIC, state=runs.ACCEPTED) if of_loops else []
        engaged = repository.engagements(connection, clutch_id)
        predicted = results.predictions_of(connection, clutch_id, SHOWN, ALL_PRESSURES)
        held_count = runs.held(connection, [clutch_id]).get(clutch_id, 0)
    measured = (item for row in rows for fit in row.receipt["fits"] for item in _measured(row.receipt, fit))
    slopes = _slopes(repository.record(clutch), rows, levels)
    lags = (item for row in dynamic for loop in row.receipt["loops"] for item in _rows_of_loop(row.receipt, loop))
    indicators = (item for row in engaged for item in _indicators(row))
    ahead = (item for row in predicted for item in _predicted(row))
    newest = predicted[-1].cycles if predicted else 0.0
    waiting = [_ahead_row(newest, "held_runs", "1", float(held_count))] if held_count else []
    items = chain(measured, slopes, lags, indicators, ahead, waiting)
    return part.sliced([item for item in items if quantity in (None, item["quantity"])])


def _measured(receipt: dict[str, Any], fit: dict[str, Any]) -> Iterator[dict[str, Any]]:
    values = [(MEAN_COF, "1", fit["mean_cof"], fit["mean_cof_sd"])]
    for public, unit in PARAMETER_UNITS.values():
        values.append((public, unit, fit["parameters"][public], fit["standard_errors"][public]))
    of_run = _columns_of_run(receipt) | {"pressure_bar": fit["pressure_bar"]}
    for quantity, unit, value, sd in values:
        yield of_run | _row(quantity, unit, value, sd)


def _slopes(
    record: ClutchIn, rows: Sequence[RunRow], levels: Mapping[str, Sequence[LevelFit]]
) -> Iterator[dict[str, Any]]:
    """dμ/dv of every fitted curve, at the usual speeds and those of the clutch's criteria."""
    geometry = record.geometry.to_model()
    limits = record.end_of_life.criteria
    speeds = sorted({*SLOPE_SPEEDS, *(limit.speed_rpm for limit in limits if limit.speed_rpm is not None)})
    for row in rows:
        for curve in curves_of(levels.get(row.run_id, ())):
            for speed in speeds:
                slope = slope_of(curve, geometry, speed)
                if slope is not None:
                    place = {"pressure_bar": bar(curve.fit.pressure), "speed_rpm": speed}
                    yield _columns_of_run(row.receipt) | _row(SLOPE, QUANTITIES[SLOPE].unit, *slope) | place


def _rows_of_loop(receipt: dict[str, Any], loop: dict[str, Any]) -> Iterator[dict[str, Any]]:
    frequency = loop["frequency_hz"]
    place = {
        "pressure_bar": loop["pressure_bar"],
        "frequency_hz": None if frequency is None else rounded_frequency(frequency),
    }
    for quantity, (value, sd) in LOOP_COLUMNS.items():
        if loop[value] is not None and loop[sd] is not None:
            yield _columns_of_run(receipt) | _row(quantity, QUANTITIES[quantity].unit, loop[value], loop[sd]) | place


def _indicators(row: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for quantity, indicator in ALL_INDICATORS.items():
        estimate = row["indicators"][quantity]
        if estimate is not None:
            yield _columns_of_run(row, row["time"]) | _row(quantity, indicator.unit, estimate["value"], estimate["sd"])


def _columns_of_run(run: dict[str, Any], time: str | None = None) -> dict[str, Any]:
    """What a row says of a run, by its receipt, or by a row that has the time."""
    time = time or run["started_at"] or run["received_at"]
    return {"cycles": run["cycles"], "time": time, "run_id": run["run_id"], "source": "run", **_NOWHERE}


def _row(quantity: str, unit: str, value: float | None, sd: float) -> dict[str, Any]:
    return {
        "quantity": quantity,
        "unit": unit,
        "value": value,
        "lower": None if value is None else value - Z90 * sd,
        "upper": None if value is None else value + Z90 * sd,
    }


def _predicted(row: PredictionRow) -> Iterator[dict[str, Any]]:
    """What was predicted after a run; with too few tests the safe bound alone: mean COF stands among the measurements."""
    payload = row.payload
    current, remaining = payload["current"], payload["remaining_cycles"]
    mean, sd = current["mean_cof"], current["mean_cof_sd"]
    if mean is None or payload["status"] == INSUFFICIENT:
        cof: tuple[float | None, ...] = (None, None, None)
    else:
        cof = (mean, mean - Z90 * sd, mean + Z90 * sd)
    yield _ahead_row(row.cycles, MEAN_COF, "1", *cof)
    yield _ahead_row(row.cycles, "health", "1", current["health"])
    quantiles = (remaining[quantile] for quantile in ("0.5", "0.05", "0.95"))
    yield _ahead_row(row.cycles, "remaining_cycles", "cycles", *quantiles)
    yield _ahead_row(row.cycles, "at_least", "cycles", payload["at_least"])
    yield _ahead_row(row.cycles, "probability_of_reaching", "1", payload["probability_of_reaching"])


def _ahead_row(
    cycles: float, quantity: str, unit: str, value: float | None, lower: float | None = None, upper: float | None = None
) -> dict[str, Any]:
    """A row of no test: over all pressures, at cycles since new."""
    return {
        "cycles": whole(cycles),
        "time": None,
        "run_id": None,
        "source": "track",
        "quantity": quantity,
        "unit": unit,
        **_NOWHERE,
        "value": value,
        "lower": lower,
        "upper": upper,
    }
