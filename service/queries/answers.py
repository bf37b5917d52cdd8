"""What is asked of a clutch: stored results, put into the public shapes."""

from collections.abc import Iterator
from typing import Any

from sqlalchemy import Connection

from models.friction.criteria import Z90
from models.friction.pressure_laws import LinearLaw, PressureLaws, fit_pressure_laws
from service import records
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, basis_of
from service.lives.prediction import named
from service.lives.receipt import PARAMETER_UNITS
from service.lives.run_analysis import LevelFit
from service.queries import views
from service.queries.engagement import engagement
from service.queries.surfaces import surfaces
from service.queries.views import Remembered
from service.readers.units import PASCALS_PER_BAR
from service.schemas.base import whole
from storage import channels, predictions, runs
from storage.engine.database import Database
from storage.predictions import PredictionRow
from storage.runs import RunRow

Place = tuple[float, str]


def remaining_life(
    database: Database,
    remembered: Remembered,
    clutch_id: str,
    *,
    method: str,
    pressure_bar: float | None,
    at_cycles: float | None,
) -> dict[str, Any]:
    """The remaining useful life as it is now, or as it would have been said at `at_cycles`.

    Raises NotFoundError for an unknown clutch or a pressure that its first stationary test did not measure.
    """
    with database.reading() as connection:
        row = records.clutch(connection, clutch_id)
        key = (clutch_id, row.revision, method, pressure_bar, at_cycles)
        said = _stored(connection, clutch_id, method, at_cycles) if pressure_bar is None else None
        said = remembered.find(key) if said is None else said
        if said is None:
            events, basis = records.events(connection, clutch_id), basis_of(connection, row)
    record = records.record(row)
    if said is None:
        fraction = record.end_of_life.cof_fraction
        said = views.foretell(
            clutch_id, events, basis, fraction, method=method, pressure_bar=pressure_bar, at_cycles=at_cycles
        )
        remembered.keep(key, said)
    return {"clutch_id": clutch_id, "method": method, "revision": row.revision, "origin": record.origin} | said


def _stored(connection: Connection, clutch_id: str, method: str, at_cycles: float | None) -> dict[str, Any] | None:
    """What was foretold over all pressures, where it is stored: what the exact filter says is worked out when asked for."""
    found = predictions.at(connection, clutch_id, method, ALL_PRESSURES, at_cycles)
    return None if found is None else found.payload


def degradation(database: Database, remembered: Remembered, clutch_id: str) -> dict[str, Any]:
    """Eq. 6 for every Stribeck parameter and for mean COF, and mean COF rebuilt from the parameters."""
    with database.reading() as connection:
        row = records.clutch(connection, clutch_id)
        key = (clutch_id, row.revision, "degradation")
        said: dict[str, Any] | None = remembered.find(key)
        if said is None:
            events, levels = records.events(connection, clutch_id), records.levels(connection, clutch_id)
            basis = basis_of(connection, row)
    if said is None:
        record = records.record(row)
        geometry, fraction = record.geometry.to_model(), record.end_of_life.cof_fraction
        said = views.degradation(clutch_id, events, basis, levels, geometry, fraction) | named(basis)
        remembered.keep(key, said)
    return {"clutch_id": clutch_id, "revision": row.revision} | said | {"next": None}


def surface(database: Database, remembered: Remembered, clutch_id: str) -> dict[str, Any]:
    """The tracked Stribeck parameters over pressure and cycles, and torque over speed besides."""
    with database.reading() as connection:
        row = records.clutch(connection, clutch_id)
        key = (clutch_id, row.revision, "surfaces")
        said: dict[str, Any] | None = remembered.find(key)
        if said is None:
            events, levels = records.events(connection, clutch_id), records.levels(connection, clutch_id)
            basis = basis_of(connection, row)
    if said is None:
        said = surfaces(clutch_id, events, basis, levels, records.record(row).geometry.to_model()) | named(basis)
        remembered.keep(key, said)
    return {"clutch_id": clutch_id, "revision": row.revision} | said


def engaged(database: Database, remembered: Remembered, clutch_id: str, *, at_cycles: float | None) -> dict[str, Any]:
    """The engagement that the tracked clutch would give at `at_cycles`, or now."""
    with database.reading() as connection:
        row = records.clutch(connection, clutch_id)
        key = (clutch_id, row.revision, "engagement", at_cycles)
        said: dict[str, Any] | None = remembered.find(key)
        if said is None:
            events, levels = records.events(connection, clutch_id), records.levels(connection, clutch_id)
            basis = basis_of(connection, row)
    record = records.record(row)
    if said is None:
        said = engagement(clutch_id, events, basis, levels, record.geometry.to_model(), at_cycles=at_cycles)
        remembered.keep(key, said)
    return {"clutch_id": clutch_id, "origin": record.origin, "simulated": True} | said


def run_page(database: Database, clutch_id: str, *, limit: int, after: Place | None) -> tuple[list[Any], Place | None]:
    """Receipts by cycles, and where the next page starts."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, limit=limit + 1, after=after)
    return _page([row.receipt for row in rows[:limit]], rows, limit)


def one_run(database: Database, clutch_id: str, run_id: str) -> dict[str, Any]:
    """A receipt with the run's channels, bit for bit as they were sent."""
    with database.reading() as connection:
        row = records.run(connection, clutch_id, run_id)
        found = channels.read(connection, row.run_key)
    return row.receipt | {"channels": {name: column.tolist() for name, column in found.items()}}


def stribeck_page(
    database: Database, remembered: Remembered, clutch_id: str, *, limit: int, after: Place | None
) -> tuple[list[Any], Place | None]:
    """Stationary tests by cycles: their fits and the pressure laws through them. An open clutch has neither."""
    with database.reading() as connection:
        row = records.clutch(connection, clutch_id)
        key = (clutch_id, row.revision, "stribeck", limit, after)
        found: tuple[list[Any], Place | None] | None = remembered.find(key)
        if found is None:
            rows = runs.page(connection, clutch_id, limit=limit + 1, after=after, fitted=True)
            levels = records.levels(connection, clutch_id)
    if found is None:
        found = _page([_stribeck_item(each, levels.get(each.run_id, [])) for each in rows[:limit]], rows, limit)
        remembered.keep(key, found)
    return found


def _page(items: list[Any], rows: list[RunRow], limit: int) -> tuple[list[Any], Place | None]:
    return items, (rows[limit - 1].cycles, rows[limit - 1].run_id) if len(rows) > limit else None


def _stribeck_item(row: RunRow, levels: list[LevelFit]) -> dict[str, Any]:
    laws = fit_pressure_laws([level.fit for level in levels])
    return {
        "run_id": row.run_id,
        "cycles": whole(row.cycles),
        "fits": row.receipt["fits"],
        "pressure_laws": None if laws is None else _laws(laws),
    }


def _laws(laws: PressureLaws) -> dict[str, Any]:
    """The pressure laws in bar, by public name."""
    found: dict[str, Any] = {}
    for name, (public, _) in PARAMETER_UNITS.items():
        law = getattr(laws, name)
        if isinstance(law, LinearLaw):
            found[public] = {"intercept": law.intercept, "slope_per_bar": law.slope * PASCALS_PER_BAR}
        else:
            found[public] = {"asymptote": law.asymptote, "excess": law.excess, "decay_bar": law.decay / PASCALS_PER_BAR}
    return found


def loop_page(database: Database, clutch_id: str) -> list[dict[str, Any]]:
    """Friction loops by cycles and pressure."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, kind="dynamic_stribeck")
    return [{"run_id": row.run_id, "cycles": whole(row.cycles)} | loop for row in rows for loop in row.receipt["loops"]]


def series(database: Database, clutch_id: str) -> Iterator[dict[str, Any]]:
    """Flat rows: each quantity of each test by cycles, then the remaining cycles as they were foretold."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = runs.page(connection, clutch_id, kind="stationary_stribeck")
        foretold = predictions.history(connection, clutch_id, "particle", ALL_PRESSURES)
    for row in rows:
        for fit in row.receipt["fits"]:
            yield from _fit_rows(row.receipt, fit)
    for each in foretold:
        yield from _foretold_rows(each)


def _fit_rows(receipt: dict[str, Any], fit: dict[str, Any]) -> Iterator[dict[str, Any]]:
    values = [(MEAN_COF, "1", fit["mean_cof"], fit["mean_cof_sd"])]
    for public, unit in PARAMETER_UNITS.values():
        values.append((public, unit, fit["parameters"][public], fit["standard_errors"][public]))
    for quantity, unit, value, sd in values:
        yield {
            "cycles": receipt["cycles"],
            "time": receipt["started_at"] or receipt["received_at"],
            "run_id": receipt["run_id"],
            "quantity": quantity,
            "unit": unit,
            "pressure_bar": fit["pressure_bar"],
            "value": value,
            "lower": None if value is None else value - Z90 * sd,
            "upper": None if value is None else value + Z90 * sd,
        }


def _foretold_rows(row: PredictionRow) -> Iterator[dict[str, Any]]:
    current, remaining = row.payload["current"], row.payload["remaining_cycles"]
    mean, sd = current["mean_cof"], current["mean_cof_sd"]
    bounds = (None, None) if mean is None else (mean - Z90 * sd, mean + Z90 * sd)
    values = (
        (MEAN_COF, "1", mean, *bounds),
        ("health", "1", current["health"], None, None),
        ("remaining_cycles", "cycles", remaining["0.5"], remaining["0.05"], remaining["0.95"]),
        ("probability_of_reaching", "1", row.payload["probability_of_reaching"], None, None),
    )
    for quantity, unit, value, lower, upper in values:
        yield {
            "cycles": whole(row.cycles),
            "time": None,
            "run_id": None,
            "quantity": quantity,
            "unit": unit,
            "pressure_bar": None,
            "value": value,
            "lower": lower,
            "upper": upper,
        }
