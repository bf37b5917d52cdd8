"""The tables of results: fitted curves, predictions, and the filters' states after the last run.

Curves are a row a run and pressure level, in SI units (Pa, Nm, m/s). Predictions are remaining life as it was predicted
after each run, a row a clutch, method, pressure (Pa; 0 = the mean) and cycles. A filter's state makes the next run one step:
a row a clutch, method and pressure.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, Select, bindparam, delete, select

from storage.encoding import Json
from storage.engine.errors import DamagedData
from storage.rows import Rows, allows_damage, refuse_damaged, upsert
from storage.tables import filter_state, fit, prediction, run

# --- fits ---


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRow:
    """One curve's fit. `covariance` is the 4 x 4 matrix, row by row, 16 numbers, and so is `unbiased_covariance`;
    `mse_percent` None on a flat curve. `measured`, where the static torque is open: the measured points' velocities, then
    their torques, then how many rows each stands for.

    `mean_cof` and its deviation, None where the curve does not determine them, are over the protocol of the first test.
    """

    pressure: float
    mean_pressure: float
    static_torque: float
    coulomb_ratio: float
    stribeck_velocity: float
    viscous_coefficient: float
    covariance: tuple[float, ...]
    unbiased_covariance: tuple[float, ...]
    status: str
    undetermined: tuple[str, ...]
    noise: float
    mse_percent: float | None
    rmse: float
    points: int
    speeds: int
    mean_cof: float | None
    mean_cof_sd: float | None
    message: str
    code_version: str
    acceptable: bool
    measured: tuple[float, ...] | None = None


_MATRICES = ("covariance", "unbiased_covariance")
_fits = Rows(FitRow, of=fit)
_determined = (
    select(fit)
    .join(run, run.c.run_key == fit.c.run_key)
    .where(run.c.clutch_id == bindparam("of"), run.c.run_key > bindparam("beyond"), fit.c.mean_cof.is_not(None))
    .order_by(fit.c.run_key, fit.c.pressure)
)


def write_fits(connection: Connection, run_key: int, rows: Sequence[FitRow]) -> None:
    """Replace the fits of a run. Raises ValueError unless each covariance has 16 finite numbers."""
    connection.execute(delete(fit).where(fit.c.run_key == run_key))
    if rows:
        connection.execute(fit.insert(), [_fit_values(run_key, row) for row in rows])


def fits_of(connection: Connection, clutch_id: str, beyond: int = 0) -> dict[int, list[FitRow]]:
    """The fits of a clutch's runs with keys `beyond` that one by run_key, runs in order, pressures ascending; runs without
    fits are left out."""
    fits: dict[int, list[FitRow]] = {}
    query = select(fit).join(run, run.c.run_key == fit.c.run_key)
    query = query.where(run.c.clutch_id == clutch_id, run.c.run_key > beyond)
    rows = connection.execute(query.order_by(run.c.cycles, run.c.run_id, fit.c.pressure))
    of = _fits.reader(rows)
    for row in rows:
        fits.setdefault(row.run_key, []).append(of(row))
    return fits


def fits_of_run(connection: Connection, run_key: int) -> list[FitRow]:
    """The fits of one run, pressures ascending."""
    return _fits.all(connection.execute(select(fit).where(fit.c.run_key == run_key).order_by(fit.c.pressure)))


def cofs_of(connection: Connection, clutch_id: str, beyond: int = 0) -> dict[int, dict[float, tuple[float, float]]]:
    """run_key -> pressure -> mean COF and its standard deviation, for all curves that determine it, of runs with keys
    `beyond` that one. Raises DamagedData."""
    cofs: dict[int, dict[float, tuple[float, float]]] = {}
    rows = connection.execute(_determined, {"of": clutch_id, "beyond": beyond})
    damage_allowed = allows_damage(rows, fit)
    for row in rows.mappings():
        if not damage_allowed:
            refuse_damaged(fit, dict(row))
        cofs.setdefault(row["run_key"], {})[row["pressure"]] = (row["mean_cof"], row["mean_cof_sd"])
    return cofs


def _fit_values(run_key: int, row: FitRow) -> dict[str, object]:
    for name in _MATRICES:
        matrix = getattr(row, name)
        if len(matrix) != 16:
            raise ValueError(f"{name} must hold 16 numbers, got {len(matrix)}")
    return _fits.values(row, run_key=run_key)


# --- predictions ---


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionRow:
    """The prediction of `method` at `cycles` for the quantity at `pressure`."""

    cycles: float
    method: str
    pressure: float
    payload: Json
    code_version: str


_predictions = Rows(PredictionRow, of=prediction)


def put_predictions(connection: Connection, clutch_id: str, rows: Sequence[PredictionRow]) -> None:
    """Store predictions, replacing those of the same method, pressure and cycles."""
    upsert(connection, prediction, [_predictions.values(row, clutch_id=clutch_id) for row in rows])


def prediction_at(
    connection: Connection, clutch_id: str, method: str, pressure: float, at_cycles: float | None = None
) -> PredictionRow | None:
    """The last prediction of a series up to `at_cycles` (None: of all); None if there is none."""
    query = _series(clutch_id, method, pressure).order_by(prediction.c.cycles.desc()).limit(1)
    if at_cycles is not None:
        query = query.where(prediction.c.cycles <= at_cycles)
    return _predictions.first(connection.execute(query))


def predictions_of(connection: Connection, clutch_id: str, method: str, pressure: float) -> list[PredictionRow]:
    query = _series(clutch_id, method, pressure).order_by(prediction.c.cycles)
    return _predictions.all(connection.execute(query))


def _series(clutch_id: str, method: str, pressure: float) -> Select[Any]:
    series = (prediction.c.clutch_id == clutch_id, prediction.c.method == method, prediction.c.pressure == pressure)
    return select(prediction).where(*series)


def clear_predictions(connection: Connection, clutch_id: str) -> None:
    connection.execute(delete(prediction).where(prediction.c.clutch_id == clutch_id))


# --- filter states ---


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterStateRow:
    """A filter's named arrays after `runs` runs; `pressure` in Pa, 0 = the mean over the reference pressures."""

    method: str
    pressure: float
    runs: int
    arrays: Mapping[str, NDArray[np.float64] | NDArray[np.bool_]]
    code_version: str


_states = Rows(FilterStateRow, of=filter_state)


def put_filter_states(connection: Connection, clutch_id: str, rows: Sequence[FilterStateRow]) -> None:
    """Store filter states, replacing those of the same method and pressure."""
    upsert(connection, filter_state, [_states.values(row, clutch_id=clutch_id) for row in rows])


def filter_states_of(connection: Connection, clutch_id: str) -> dict[tuple[str, float], FilterStateRow]:
    """The states of a clutch by (method, pressure). Raises DamagedData, naming the state."""
    states = {}
    query = select(filter_state).where(filter_state.c.clutch_id == clutch_id)
    rows = connection.execute(query.order_by(filter_state.c.method, filter_state.c.pressure))
    of = _states.reader(rows)
    for row in rows:
        try:
            states[row.method, row.pressure] = of(row)
        except DamagedData as error:
            name = f"state of {row.method} at {row.pressure:g} Pa of clutch {clutch_id!r}"
            raise DamagedData(f"{name}: {error}") from error
    return states


def states_sum(connection: Connection, clutch_id: str) -> int:
    """A checksum over those of a clutch's states."""
    query = select(filter_state.c.checksum).where(filter_state.c.clutch_id == clutch_id)
    sums = connection.execute(query.order_by(filter_state.c.method, filter_state.c.pressure)).scalars()
    return zlib.crc32(b",".join(b"%d" % checksum for checksum in sums))


def clear_filter_states(connection: Connection, clutch_id: str) -> None:
    connection.execute(delete(filter_state).where(filter_state.c.clutch_id == clutch_id))
