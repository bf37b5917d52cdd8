"""Runs: the request as it was stored, and the receipt that answered it. Their order is by cycles, then by run_id."""

from dataclasses import dataclass, fields

import sqlalchemy as sa
from sqlalchemy import Connection, Row, bindparam, exists, func, or_, select, tuple_, update

from storage.encoding.json_text import Json, to_object, to_text
from storage.tables import fit, run


@dataclass(frozen=True, slots=True, kw_only=True)
class NewRun:
    """A run that is about to be stored. `cycles` since new; `details` holds what only some kinds have."""

    clutch_id: str
    run_id: str
    kind: str
    cycles: float
    started_at: str | None
    received_at: str
    content_sha256: str
    details: Json
    receipt: Json
    code_version: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow(NewRun):
    """A stored run; `run_key` is what the rows of its channels and fits refer to."""

    run_key: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInOrder:
    """As much of a run as tracking needs; a stationary test has the range of its speeds, maintenance its event, a block of
    duty its load (in the units in which it was sent)."""

    run_key: int
    run_id: str
    kind: str
    cycles: float
    started_at: str | None
    received_at: str
    lowest_speed: float | None
    highest_speed: float | None
    event: str | None
    duty_cycles: float | None = None
    duty_energy_kj: float | None = None
    duty_speed_rpm: float | None = None
    duty_duration_s: float | None = None


_insert = sa.insert(run)
_of_clutch = run.c.clutch_id == bindparam("of_clutch")
_by_id = select(run).where(_of_clutch, run.c.run_id == bindparam("wanted"))
_ordered = (
    select(run)
    .where(_of_clutch, or_(bindparam("of_kind").is_(None), run.c.kind == bindparam("of_kind")))
    .order_by(run.c.cycles, run.c.run_id)
    .limit(bindparam("most"))
)
_after = tuple_(run.c.cycles, run.c.run_id) > tuple_(bindparam("after_cycles"), bindparam("after_id"))
_fitted = exists().where(fit.c.run_key == run.c.run_key)
_LIGHT = tuple(field.name for field in fields(RunInOrder))
_light = (
    select(
        *(run.c[name] for name in _LIGHT[:6]),
        func.json_extract(run.c.details, "$.speed_range[0]"),
        func.json_extract(run.c.details, "$.speed_range[1]"),
        func.json_extract(run.c.details, "$.event"),
        func.json_extract(run.c.details, "$.duty.cycles"),
        func.json_extract(run.c.details, "$.duty.energy_per_cycle_kj"),
        func.json_extract(run.c.details, "$.duty.initial_speed_rpm"),
        func.json_extract(run.c.details, "$.duty.engagement_duration_s"),
    )
    .where(_of_clutch)
    .order_by(run.c.cycles, run.c.run_id)
)
_rebuilds = _light.where(func.json_extract(run.c.details, "$.event") == "rebuild")
_set_results = update(run).where(run.c.run_key == bindparam("wanted"))


def insert(connection: Connection, row: NewRun) -> int:
    """Store a new run and return its key. Raises IntegrityError where the clutch is unknown or has this run_id."""
    values = {field.name: getattr(row, field.name) for field in fields(NewRun)}
    values["details"] = to_text(row.details)
    values["receipt"] = to_text(row.receipt)
    return connection.execute(_insert, values).lastrowid


def get(connection: Connection, clutch_id: str, run_id: str) -> RunRow | None:
    """The run, or None."""
    row = connection.execute(_by_id, {"of_clutch": clutch_id, "wanted": run_id}).first()
    return None if row is None else _row(row)


def page(
    connection: Connection,
    clutch_id: str,
    *,
    limit: int | None = None,
    after: tuple[float, str] | None = None,
    kind: str | None = None,
    fitted: bool = False,
) -> list[RunRow]:
    """Runs of a clutch in order, of one kind or all, at most `limit`, behind `after`, the (cycles, run_id) of another.

    `fitted`: only runs through which a curve was fitted.
    """
    values: dict[str, object] = {"of_clutch": clutch_id, "of_kind": kind, "most": -1 if limit is None else limit}
    query = _ordered.where(_fitted) if fitted else _ordered
    if after is not None:
        query = query.where(_after)
        values |= {"after_cycles": after[0], "after_id": after[1]}
    return [_row(row) for row in connection.execute(query, values)]


def in_order(connection: Connection, clutch_id: str) -> list[RunInOrder]:
    """All runs of a clutch in order, without their receipts."""
    rows = connection.execute(_light, {"of_clutch": clutch_id})
    return [RunInOrder(**dict(zip(_LIGHT, values, strict=True))) for values in rows]


def rebuilds(connection: Connection, clutch_id: str) -> list[RunInOrder]:
    """The rebuilds of a clutch in order."""
    rows = connection.execute(_rebuilds, {"of_clutch": clutch_id})
    return [RunInOrder(**dict(zip(_LIGHT, values, strict=True))) for values in rows]


def set_results(connection: Connection, run_key: int, details: Json, receipt: Json, code_version: str) -> None:
    """Replace a run's details and receipt, as a recomputation does. Raises LookupError on an unknown run."""
    texts = {"details": to_text(details), "receipt": to_text(receipt)}
    values = {"wanted": run_key, "code_version": code_version} | texts
    if connection.execute(_set_results, values).rowcount != 1:
        raise LookupError(f"run {run_key} is not stored")


def set_receipt(connection: Connection, run_key: int, receipt: Json) -> None:
    """Replace a run's receipt alone. Raises LookupError on an unknown run."""
    if connection.execute(_set_results, {"wanted": run_key, "receipt": to_text(receipt)}).rowcount != 1:
        raise LookupError(f"run {run_key} is not stored")


def _row(row: Row[tuple[object, ...]]) -> RunRow:
    values = row._asdict()
    values["details"] = to_object(values["details"])
    values["receipt"] = to_object(values["receipt"])
    return RunRow(**values)
