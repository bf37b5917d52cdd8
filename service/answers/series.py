"""`/series`: flat rows for dashboards and spreadsheets, every fitted quantity and then the predictions.

Every row is stored or follows in closed form from a stored fit, as the slopes do: nothing is fitted or tracked here.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from models.friction.criteria import Z90
from service import repository
from service.api.clutch import ClutchIn
from service.api.life import LifePrediction
from service.api.over_life import MeasuredEngagement, SeriesItem, SeriesPage
from service.api.run import Fit, Loop, Receipt
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
from service.tables import Cells
from storage import results, runs
from storage.engine.database import Database


def series(database: Database, clutch_id: str, part: Part, quantity: str | None) -> SeriesPage:
    """The time series of a clutch, of one quantity or all: each quantity of each test by cycles, slopes of its curves,
    quantities of friction loops, indicators of engagements, then the predicted remaining cycles; and the number of held
    runs.

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
    tests, dynamic_tests = list(map(repository.receipt, rows)), map(repository.receipt, dynamic)
    measured = (item for test in tests for fit in test.fits for item in _measured(_RunColumns.of(test), fit))
    slopes = _slopes(repository.record(clutch), tests, levels)
    lags = (item for test in dynamic_tests for loop in test.loops for item in _rows_of_loop(_RunColumns.of(test), loop))
    indicators = (item for row in engaged for item in _indicators(row))
    ahead = (item for row in predicted for item in _predicted(row.cycles, repository.prediction(row)))
    newest = predicted[-1].cycles if predicted else 0.0
    waiting = [_ahead_row(newest, "held_runs", "1", float(held_count))] if held_count else []
    items = chain(measured, slopes, lags, indicators, ahead, waiting)
    shown = part.sliced([item for item in items if quantity in (None, item.quantity)])
    return SeriesPage(items=[*shown.items], next=shown.next)


COLUMNS = (
    "cycles", "time", "run_id", "quantity", "unit", "pressure_bar", "value", "lower", "upper", "frequency_hz", "speed_rpm",
    "source",
)  # fmt: skip


def rows(page: SeriesPage) -> Iterator[Cells]:
    """The time series as rows of a table."""
    return map(dict, page.items)


@dataclass(frozen=True, slots=True)
class _RunColumns:
    """The run's columns, the same in all its rows."""

    run_id: str
    cycles: float
    time: str

    @classmethod
    def of(cls, receipt: Receipt) -> "_RunColumns":
        return cls(receipt.run_id, receipt.cycles, receipt.started_at or receipt.received_at)

    def row(
        self,
        quantity: str,
        unit: str,
        value: float | None,
        sd: float | None,
        *,
        pressure_bar: float | None = None,
        frequency_hz: float | None = None,
        speed_rpm: float | None = None,
    ) -> SeriesItem:
        """A row with a value and its 90 % interval."""
        return SeriesItem(
            cycles=self.cycles,
            time=self.time,
            run_id=self.run_id,
            source="run",
            pressure_bar=pressure_bar,
            frequency_hz=frequency_hz,
            speed_rpm=speed_rpm,
            quantity=quantity,
            unit=unit,
            value=value,
            lower=None if value is None or sd is None else value - Z90 * sd,
            upper=None if value is None or sd is None else value + Z90 * sd,
        )


def _measured(run: _RunColumns, fit: Fit) -> Iterator[SeriesItem]:
    """Mean COF and the Stribeck parameters of a fitted curve, a row each."""
    yield run.row(MEAN_COF, "1", fit.mean_cof, fit.mean_cof_sd, pressure_bar=fit.pressure_bar)
    for public, unit in PARAMETER_UNITS.values():
        value, sd = getattr(fit.parameters, public), getattr(fit.standard_errors, public)
        yield run.row(public, unit, value, sd, pressure_bar=fit.pressure_bar)


def _slopes(
    record: ClutchIn, receipts: Sequence[Receipt], levels: Mapping[str, Sequence[LevelFit]]
) -> Iterator[SeriesItem]:
    """The slope dμ/dv of every fitted curve, at the usual speeds and those of the clutch's criteria."""
    geometry = record.geometry.to_model()
    limits = record.end_of_life.criteria
    speeds = sorted({*SLOPE_SPEEDS, *(limit.speed_rpm for limit in limits if limit.speed_rpm is not None)})
    for receipt in receipts:
        run = _RunColumns.of(receipt)
        for curve in curves_of(levels.get(run.run_id, ())):
            for speed in speeds:
                slope = slope_of(curve, geometry, speed)
                if slope is not None:
                    pressure = bar(curve.fit.pressure)
                    yield run.row(SLOPE, QUANTITIES[SLOPE].unit, *slope, pressure_bar=pressure, speed_rpm=speed)


def _rows_of_loop(run: _RunColumns, loop: Loop) -> Iterator[SeriesItem]:
    """The quantities of a friction loop, a row each."""
    frequency = None if loop.frequency_hz is None else rounded_frequency(loop.frequency_hz)
    for quantity, names in LOOP_COLUMNS.items():
        value, sd = (getattr(loop, name) for name in names)
        if value is not None and sd is not None:
            unit = QUANTITIES[quantity].unit
            yield run.row(quantity, unit, value, sd, pressure_bar=loop.pressure_bar, frequency_hz=frequency)


def _indicators(row: MeasuredEngagement) -> Iterator[SeriesItem]:
    """The indicators of an engagement, a row each."""
    run = _RunColumns(row.run_id, row.cycles, row.time)
    for quantity, indicator in ALL_INDICATORS.items():
        estimate = getattr(row.indicators, quantity)
        if estimate is not None:
            yield run.row(quantity, indicator.unit, estimate.value, estimate.sd)


def _predicted(cycles: float, prediction: LifePrediction) -> Iterator[SeriesItem]:
    """Rows of the prediction after a run: mean COF, health, remaining cycles, safe bound and probability of reaching
    it. With too few tests mean COF is empty, because the measurements already show it."""
    current, remaining = prediction.current, prediction.remaining_cycles
    mean, sd = current.mean_cof, current.mean_cof_sd
    if mean is None or sd is None or prediction.status == INSUFFICIENT:
        cof: tuple[float | None, ...] = (None, None, None)
    else:
        cof = (mean, mean - Z90 * sd, mean + Z90 * sd)
    yield _ahead_row(cycles, MEAN_COF, "1", *cof)
    yield _ahead_row(cycles, "health", "1", current.health)
    quantiles = (remaining[quantile] for quantile in ("0.5", "0.05", "0.95"))
    yield _ahead_row(cycles, "remaining_cycles", "cycles", *quantiles)
    yield _ahead_row(cycles, "at_least", "cycles", prediction.at_least)
    yield _ahead_row(cycles, "probability_of_reaching", "1", prediction.probability_of_reaching)


def _ahead_row(
    cycles: float, quantity: str, unit: str, value: float | None, lower: float | None = None, upper: float | None = None
) -> SeriesItem:
    """A row of a prediction, which has no run: over all pressures, at cycles since new."""
    return SeriesItem(
        cycles=whole(cycles),
        time=None,
        run_id=None,
        source="track",
        pressure_bar=None,
        frequency_hz=None,
        speed_rpm=None,
        quantity=quantity,
        unit=unit,
        value=value,
        lower=lower,
        upper=upper,
    )
