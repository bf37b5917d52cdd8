"""Remaining life as it was predicted after each run: one row a clutch, method, pressure (Pa; 0 = their mean) and cycles."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, bindparam, delete, select
from sqlalchemy.dialects.sqlite import insert

from storage.encoding.json_text import Json, to_object, to_text
from storage.tables import prediction


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionRow:
    """The prediction of `method` at `cycles` for the quantity at `pressure`."""

    cycles: float
    method: str
    pressure: float
    payload: Json
    code_version: str


_new = insert(prediction)
_put = _new.on_conflict_do_update(
    index_elements=["clutch_id", "method", "pressure", "cycles"],
    set_={"payload": _new.excluded.payload, "code_version": _new.excluded.code_version},
)
_of_clutch = prediction.c.clutch_id == bindparam("of_clutch")
_series = select(
    prediction.c.cycles, prediction.c.method, prediction.c.pressure, prediction.c.payload, prediction.c.code_version
).where(_of_clutch, prediction.c.method == bindparam("of_method"), prediction.c.pressure == bindparam("of_pressure"))
_history = _series.order_by(prediction.c.cycles)
_last = _series.order_by(prediction.c.cycles.desc()).limit(1)
_last_at = _last.where(prediction.c.cycles <= bindparam("at_most"))
_clear = delete(prediction).where(_of_clutch)


def put(connection: Connection, clutch_id: str, rows: Sequence[PredictionRow]) -> None:
    """Store predictions, each in place of the one of the same method, pressure and cycles."""
    values = [
        {
            "clutch_id": clutch_id,
            "method": row.method,
            "pressure": row.pressure,
            "cycles": row.cycles,
            "payload": to_text(row.payload),
            "code_version": row.code_version,
        }
        for row in rows
    ]
    if values:
        connection.execute(_put, values)


def at(
    connection: Connection, clutch_id: str, method: str, pressure: float, at_cycles: float | None = None
) -> PredictionRow | None:
    """The last prediction of a series, or the last one not beyond `at_cycles`; None where there is none."""
    values: dict[str, str | float] = {"of_clutch": clutch_id, "of_method": method, "of_pressure": pressure}
    if at_cycles is None:
        row = connection.execute(_last, values).first()
    else:
        row = connection.execute(_last_at, {**values, "at_most": at_cycles}).first()
    return None if row is None else _row(*row)


def history(connection: Connection, clutch_id: str, method: str, pressure: float) -> list[PredictionRow]:
    """All predictions of a series, cycles ascending."""
    values = {"of_clutch": clutch_id, "of_method": method, "of_pressure": pressure}
    return [_row(*row) for row in connection.execute(_history, values)]


def clear(connection: Connection, clutch_id: str) -> None:
    """Drop all predictions of a clutch, which are about to be computed again."""
    connection.execute(_clear, {"of_clutch": clutch_id})


def _row(cycles: float, method: str, pressure: float, payload: str, code_version: str) -> PredictionRow:
    return PredictionRow(
        cycles=cycles, method=method, pressure=pressure, payload=to_object(payload), code_version=code_version
    )
