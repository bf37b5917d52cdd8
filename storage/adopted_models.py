"""The models under which a clutch has been tracked, by version; the newest is in force.

Beside the versions, the mean COFs of runs as the model in force corrects them; they go before those of the fits.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, bindparam, delete, select

from storage.tables import adopted_model, corrected_cof, run


@dataclass(frozen=True, slots=True, kw_only=True)
class AdoptedRow:
    """A version from 1 on; `diagnosis_id` None is a return to the baseline."""

    version: int
    diagnosis_id: str | None
    adopted_at: str


_versions = (
    select(adopted_model.c.version, adopted_model.c.diagnosis_id, adopted_model.c.adopted_at)
    .where(adopted_model.c.clutch_id == bindparam("of_clutch"))
    .order_by(adopted_model.c.version.desc())
)
_newest = _versions.limit(1)
_adopt = sa.insert(adopted_model)
_cofs = (
    select(corrected_cof.c.run_key, corrected_cof.c.pressure, corrected_cof.c.mean_cof, corrected_cof.c.mean_cof_sd)
    .join(run, run.c.run_key == corrected_cof.c.run_key)
    .where(run.c.clutch_id == bindparam("of_clutch"))
    .order_by(corrected_cof.c.run_key, corrected_cof.c.pressure)
)
_write = sa.insert(corrected_cof)
_clear_run = delete(corrected_cof).where(corrected_cof.c.run_key == bindparam("of_run"))
_clear = delete(corrected_cof).where(
    corrected_cof.c.run_key.in_(select(run.c.run_key).where(run.c.clutch_id == bindparam("of_clutch")))
)


def current(connection: Connection, clutch_id: str) -> AdoptedRow | None:
    """The version in force, None before the first."""
    row = connection.execute(_newest, {"of_clutch": clutch_id}).first()
    return None if row is None else AdoptedRow(**row._asdict())


def versions(connection: Connection, clutch_id: str) -> list[AdoptedRow]:
    """All versions, newest first."""
    return [AdoptedRow(**row._asdict()) for row in connection.execute(_versions, {"of_clutch": clutch_id})]


def adopt(connection: Connection, clutch_id: str, row: AdoptedRow) -> None:
    """Store a version. Raises IntegrityError where it is there or its diagnosis unknown."""
    connection.execute(_adopt, {"clutch_id": clutch_id} | asdict(row))


def corrected_cofs(connection: Connection, clutch_id: str) -> dict[int, dict[float, tuple[float, float]]]:
    """run_key -> pressure -> mean COF and its deviation under the model in force, where it corrects them."""
    cofs: dict[int, dict[float, tuple[float, float]]] = {}
    for run_key, pressure, mean, deviation in connection.execute(_cofs, {"of_clutch": clutch_id}):
        cofs.setdefault(run_key, {})[pressure] = (mean, deviation)
    return cofs


def write_corrected(connection: Connection, run_key: int, cofs: Mapping[float, tuple[float, float]]) -> None:
    """Store a run's corrected mean COFs by pressure in place of those it had."""
    connection.execute(_clear_run, {"of_run": run_key})
    rows = [
        {"run_key": run_key, "pressure": pressure, "mean_cof": mean, "mean_cof_sd": deviation}
        for pressure, (mean, deviation) in cofs.items()
    ]
    if rows:
        connection.execute(_write, rows)


def clear_corrected(connection: Connection, clutch_id: str) -> None:
    """Drop all corrected mean COFs of a clutch."""
    connection.execute(_clear, {"of_clutch": clutch_id})
