"""The state of each filter after the last run, so that the next is one step: a row a clutch, method and pressure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, bindparam, delete, select
from sqlalchemy.dialects.sqlite import insert

from storage.encoding.codec import pack, unpack
from storage.engine.errors import DamagedData
from storage.tables import filter_state


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterStateRow:
    """A filter's named arrays after `runs` runs; `pressure` in Pa, 0 = the mean over the reference pressures."""

    method: str
    pressure: float
    runs: int
    arrays: Mapping[str, NDArray[np.float64]]
    code_version: str


_new = insert(filter_state)
_put = _new.on_conflict_do_update(
    index_elements=["clutch_id", "method", "pressure"],
    set_={"runs": _new.excluded.runs, "arrays": _new.excluded.arrays, "code_version": _new.excluded.code_version},
)
_of_clutch = filter_state.c.clutch_id == bindparam("of_clutch")
_get = (
    select(
        filter_state.c.method,
        filter_state.c.pressure,
        filter_state.c.runs,
        filter_state.c.arrays,
        filter_state.c.code_version,
    )
    .where(_of_clutch)
    .order_by(filter_state.c.method, filter_state.c.pressure)
)
_clear = delete(filter_state).where(_of_clutch)


def put(connection: Connection, clutch_id: str, rows: Sequence[FilterStateRow]) -> None:
    """Store states, each in place of the one of the same method and pressure."""
    values = [
        {
            "clutch_id": clutch_id,
            "method": row.method,
            "pressure": row.pressure,
            "runs": row.runs,
            "arrays": pack(row.arrays),
            "code_version": row.code_version,
        }
        for row in rows
    ]
    if values:
        connection.execute(_put, values)


def get(connection: Connection, clutch_id: str) -> dict[tuple[str, float], FilterStateRow]:
    """The states of a clutch by (method, pressure). Raises DamagedData, naming the state."""
    states = {}
    for method, pressure, runs, data, code_version in connection.execute(_get, {"of_clutch": clutch_id}):
        try:
            arrays = unpack(data)
        except DamagedData as error:
            raise DamagedData(f"state of {method} at {pressure:g} Pa of clutch {clutch_id!r}: {error}") from error
        states[method, pressure] = FilterStateRow(
            method=method, pressure=pressure, runs=runs, arrays=arrays, code_version=code_version
        )
    return states


def clear(connection: Connection, clutch_id: str) -> None:
    """Drop all states of a clutch, which are about to be computed again."""
    connection.execute(_clear, {"of_clutch": clutch_id})
