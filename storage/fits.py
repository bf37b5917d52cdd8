"""The fitted Stribeck curves of a run, one row a pressure level. SI units: Pa, Nm, m/s."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import sqlalchemy as sa
from sqlalchemy import Connection, Row, bindparam, delete, select

from storage.encoding.json_text import to_list, to_text
from storage.tables import fit, run


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRow:
    """One curve's fit. `covariance` is the 4 x 4 matrix, row by row, 16 numbers; `mse_percent` None on a flat curve.

    `mean_cof` and its deviation, None where the curve does not determine them, are over the protocol of the first test.
    """

    pressure: float
    mean_pressure: float
    static_torque: float
    coulomb_ratio: float
    stribeck_velocity: float
    viscous_coefficient: float
    covariance: tuple[float, ...]
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


_NAMES = tuple(field.name for field in fields(FitRow))
_columns = [fit.c.run_key, *(fit.c[name] for name in _NAMES)]
_insert = sa.insert(fit)
_delete = delete(fit).where(fit.c.run_key == bindparam("of_run"))
_of_clutch = (
    select(*_columns)
    .join(run, run.c.run_key == fit.c.run_key)
    .where(run.c.clutch_id == bindparam("of_clutch"))
    .order_by(run.c.cycles, run.c.run_id, fit.c.pressure)
)


_cofs_of_clutch = (
    select(fit.c.run_key, fit.c.pressure, fit.c.mean_cof, fit.c.mean_cof_sd)
    .join(run, run.c.run_key == fit.c.run_key)
    .where(run.c.clutch_id == bindparam("of_clutch"), fit.c.mean_cof.is_not(None))
    .order_by(fit.c.run_key, fit.c.pressure)
)


def write(connection: Connection, run_key: int, rows: Sequence[FitRow]) -> None:
    """Store the fits of a run in place of those it had. Raises ValueError unless a covariance has 16 finite numbers."""
    connection.execute(_delete, {"of_run": run_key})
    if rows:
        connection.execute(_insert, [_values(run_key, row) for row in rows])


def of_clutch(connection: Connection, clutch_id: str) -> dict[int, list[FitRow]]:
    """The fits of a clutch's runs by run_key, runs in order, pressures ascending; runs without fits are left out."""
    fits: dict[int, list[FitRow]] = {}
    for row in connection.execute(_of_clutch, {"of_clutch": clutch_id}):
        run_key, curve = _row(row)
        fits.setdefault(run_key, []).append(curve)
    return fits


def cofs_of_clutch(connection: Connection, clutch_id: str) -> dict[int, dict[float, tuple[float, float]]]:
    """run_key -> pressure -> mean COF and its deviation, of all curves that determine it: as much as tracking needs."""
    cofs: dict[int, dict[float, tuple[float, float]]] = {}
    for run_key, pressure, mean, deviation in connection.execute(_cofs_of_clutch, {"of_clutch": clutch_id}):
        cofs.setdefault(run_key, {})[pressure] = (mean, deviation)
    return cofs


def _values(run_key: int, row: FitRow) -> dict[str, object]:
    if len(row.covariance) != 16:
        raise ValueError(f"covariance must hold 16 numbers, got {len(row.covariance)}")
    values = {name: getattr(row, name) for name in _NAMES}
    values["covariance"] = to_text(row.covariance)
    values["undetermined"] = to_text(row.undetermined)
    return {"run_key": run_key, **values}


def _row(row: Row[Any]) -> tuple[int, FitRow]:
    run_key: int = row[0]
    values: dict[str, Any] = dict(zip(_NAMES, row[1:], strict=True))
    values["covariance"] = tuple(to_list(values["covariance"]))
    values["undetermined"] = tuple(to_list(values["undetermined"]))
    return run_key, FitRow(**values)
