"""The table of runs: each request as stored, and its receipt. Their order is by cycles, then by run_id.

Only accepted runs are part of a clutch's history; those that are held or were withdrawn stay stored beside them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from sqlalchemy import (
    ColumnElement,
    Connection,
    Result,
    Select,
    TextClause,
    and_,
    bindparam,
    exists,
    func,
    select,
    tuple_,
)

from storage.dialects import DialectPair, json_text, json_value
from storage.encoding import Json
from storage.rows import Rows, allows_damage, amend, fails, refuse_damaged
from storage.tables import HELD_ONLY, fit, run

ACCEPTED, HELD, WITHDRAWN = "accepted", "held", "withdrawn"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow:
    """A run. `cycles` since new; `details` holds what only some kinds have; `doubts` are why it is or was held,
    `sent_cycles` the cycles as they were sent where `cycles` was corrected since, else None; `received_by` is who posted
    it. Channels and fits refer to its key; the later it arrived, the greater."""

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
    state: str = ACCEPTED
    sent_cycles: float | None = None
    doubts: Sequence[Any] = ()
    received_by: str | None = None
    run_key: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiptRow:
    """The fields of a run that lists show; `receipt` and `doubts` as stored JSON text."""

    run_id: str
    cycles: float
    receipt: str
    state: str
    sent_cycles: float | None
    doubts: str
    received_by: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInOrder:
    """As much of a run as tracking and doubts need; a stationary test has the range of its speeds and the mean and
    the range of its oil's temperature [K], maintenance its event, a block of duty its load (in the units in which it
    was sent). `doubted`: there are or were doubts; `shown` is what it shows of friction, as JSON text; `follows` the
    clutch's revision to which the run was appended, None where it changed more."""

    run_key: int
    run_id: str
    kind: str
    cycles: float
    started_at: str | None
    received_at: str
    lowest_speed: float | None
    highest_speed: float | None
    event: str | None
    doubted: bool = False
    shown: str | None = None
    reason: str | None = None
    oil_temperature: float | None = None
    coldest_oil: float | None = None
    warmest_oil: float | None = None
    duty_cycles: float | None = None
    duty_energy_kj: float | None = None
    duty_speed_rpm: float | None = None
    duty_duration_s: float | None = None
    state: str = ACCEPTED
    follows: int | None = None


_stored, _listed = Rows(RunRow, key="run_key", of=run), Rows(ReceiptRow)
_ORDER = (run.c.cycles, run.c.run_id)
_LIGHT = tuple(field.name for field in fields(RunInOrder))
_light = select(
    *(run.c[name] for name in _LIGHT[:6]),
    json_value(run.c.details, "speed_range", 0),
    json_value(run.c.details, "speed_range", 1),
    json_value(run.c.details, "event"),
    run.c.doubts != "[]",
    json_text(run.c.details, "shown"),
    json_value(run.c.details, "reason"),
    json_value(run.c.details, "oil_temperature"),
    json_value(run.c.details, "oil_range", 0),
    json_value(run.c.details, "oil_range", 1),
    json_value(run.c.details, "duty", "cycles"),
    json_value(run.c.details, "duty", "energy_per_cycle_kj"),
    json_value(run.c.details, "duty", "initial_speed_rpm"),
    json_value(run.c.details, "duty", "engagement_duration_s"),
    run.c.state,
    json_value(run.c.details, "follows"),
).order_by(*_ORDER)
#: Those of a clutch whose keys are beyond one.
_beyond = run.c.clutch_id == bindparam("of"), run.c.run_key > bindparam("beyond")
_named = select(run).where(run.c.clutch_id == bindparam("of"), run.c.run_id == bindparam("name"))
_later, _whole = _light.where(*_beyond), select(run).where(*_beyond)
_held = select(run.c.clutch_id, func.count()).where(HELD_ONLY).group_by(run.c.clutch_id)


def insert(connection: Connection, row: RunRow) -> int:
    """Store a new run and return its key. Raises IntegrityError where the clutch is unknown or has this run_id."""
    run_key: int = next(iter(connection.execute(run.insert(), _stored.values(row)).inserted_primary_key or ()))
    return run_key


def get(connection: Connection, clutch_id: str, run_id: str) -> RunRow | None:
    return _stored.first(connection.execute(_named, {"of": clutch_id, "name": run_id}))


def read_again_as(connection: Connection, clutch_id: str, content_sha256: str) -> RunRow | None:
    """The run whose file was read again with this content, else None."""
    content = json_text(run.c.details, "file", "content_sha256") == content_sha256
    return _stored.first(connection.execute(select(run).where(run.c.clutch_id == clutch_id, content)))


def page(
    connection: Connection,
    clutch_id: str,
    *,
    limit: int | None = None,
    after: tuple[float, str] | None = None,
    kind: str | None = None,
    state: str | None = None,
    fitted: bool = False,
) -> list[RunRow]:
    """A page of a clutch's runs in order, at most `limit`, after `after`, the (cycles, run_id) of another.

    Of one kind or all, in one state or any; `fitted`: only runs through which a curve was fitted.
    """
    query = _chosen(select(run), clutch_id, after, kind, state).limit(limit)
    if fitted:
        query = query.where(exists().where(fit.c.run_key == run.c.run_key))
    return _stored.all(connection.execute(query))


def receipts(
    connection: Connection,
    clutch_id: str,
    *,
    limit: int,
    after: tuple[float, str] | None = None,
    state: str | None = None,
    kind: str | None = None,
) -> list[ReceiptRow]:
    """Receipts, with only the fields that lists show."""
    shown = select(*(run.c[name] for name in _listed.names))
    return _listed.all(connection.execute(_chosen(shown, clutch_id, after, kind, state).limit(limit)))


def _chosen(
    query: Select[Any], clutch_id: str, after: tuple[float, str] | None, kind: str | None, state: str | None
) -> Select[Any]:
    query = query.where(run.c.clutch_id == clutch_id).order_by(*_ORDER)
    if after is not None:
        query = query.where(tuple_(*_ORDER) > tuple_(*after))
    if kind is not None:
        query = query.where(run.c.kind == kind)
    if state is not None:
        query = query.where(run.c.state == state)
    return query


def in_order(connection: Connection, clutch_id: str) -> list[RunInOrder]:
    """The accepted runs of a clutch in order, without their receipts."""
    return _in_order(connection, clutch_id, run.c.state == ACCEPTED)


def newest_fitted(connection: Connection, clutch_id: str, kind: str) -> int | None:
    """The key of the last accepted run of a kind, in order, with fits; None if there is none."""
    query = _chosen(select(run.c.run_key), clutch_id, None, kind, ACCEPTED).order_by(None)
    query = query.where(exists().where(fit.c.run_key == run.c.run_key))
    key: int | None = connection.execute(query.order_by(*(column.desc() for column in _ORDER)).limit(1)).scalar()
    return key


def in_history(connection: Connection, clutch_id: str) -> list[RunInOrder]:
    """The accepted and held runs of a clutch in order."""
    return _in_order(connection, clutch_id, run.c.state != WITHDRAWN)


def after_key(connection: Connection, clutch_id: str, run_key: int) -> list[RunInOrder]:
    """The runs of a clutch with keys greater than that one, in order, in any state."""
    return _runs_in_order(connection.execute(_later, {"of": clutch_id, "beyond": run_key}))


def refuse_damaged_runs(connection: Connection, clutch_id: str, beyond: int = 0) -> None:
    """Raise DamagedData if any run of a clutch with a key `beyond` that one fails its checksum, in any state. Queries
    of some columns cannot check it."""
    rows = connection.execute(_whole, {"of": clutch_id, "beyond": beyond})
    if not allows_damage(rows, run):
        for row in rows.mappings():
            refuse_damaged(run, dict(row))


def damaged(connection: Connection, clutch_id: str) -> set[str]:
    """The names of a clutch's runs that fail their checksums."""
    rows = connection.execute(_whole, {"of": clutch_id, "beyond": 0}).mappings()
    return {row["run_id"] for row in rows if fails(run, dict(row))}


def last_key(connection: Connection, clutch_id: str) -> int:
    """The greatest key of a clutch's runs, 0 if it has none."""
    newest = select(func.coalesce(func.max(run.c.run_key), 0)).where(run.c.clutch_id == clutch_id)
    return int(connection.execute(newest).scalar_one())


def rebuilds(connection: Connection, clutch_id: str) -> list[RunInOrder]:
    rebuild = json_text(run.c.details, "event") == "rebuild"
    return _in_order(connection, clutch_id, and_(run.c.state == ACCEPTED, rebuild))


def set_aside(connection: Connection, clutch_id: str) -> list[RunInOrder]:
    """The held and withdrawn runs of a clutch, in order."""
    return _in_order(connection, clutch_id, run.c.state != ACCEPTED)


def _in_order(connection: Connection, clutch_id: str, chosen: ColumnElement[bool] | TextClause) -> list[RunInOrder]:
    return _runs_in_order(connection.execute(_light.where(run.c.clutch_id == clutch_id, chosen)))


def _runs_in_order(rows: Result[Any]) -> list[RunInOrder]:
    return [RunInOrder(**dict(zip(_LIGHT, values, strict=True))) for values in rows]


def held(connection: Connection, clutch_ids: Sequence[str]) -> dict[str, int]:
    """clutch_id -> number of held runs, for those of these clutches that have any."""
    rows = connection.execute(_held.where(run.c.clutch_id.in_(clutch_ids)))
    return {clutch_id: int(count) for clutch_id, count in rows}


def count(connection: Connection) -> int:
    # of SQLite's keys none is left out: the greatest one counts the runs, for none is ever deleted
    number = DialectPair(func.coalesce(func.max(run.c.run_key), 0), func.count(run.c.run_key))
    return int(connection.execute(select(number)).scalar_one())


def count_held(connection: Connection) -> int:
    return connection.execute(select(func.count()).select_from(run).where(HELD_ONLY)).scalar_one()


def keys(connection: Connection, clutch_id: str) -> dict[str, int]:
    rows = connection.execute(select(run.c.run_id, run.c.run_key).where(run.c.clutch_id == clutch_id))
    return {row.run_id: row.run_key for row in rows}


def set_results(connection: Connection, run_key: int, details: Json, receipt: Json, code_version: str) -> None:
    """Replace a run's details and receipt after a recomputation. Raises LookupError on an unknown run."""
    _change(connection, run_key, details=details, receipt=receipt, code_version=code_version)


def set_receipt(connection: Connection, run_key: int, receipt: Json) -> None:
    """Replace a run's receipt alone. Raises LookupError on an unknown run."""
    _change(connection, run_key, receipt=receipt)


def set_state(
    connection: Connection, run_key: int, *, state: str, cycles: float, sent_cycles: float | None, doubts: Sequence[Any]
) -> None:
    """Change a run's state, cycles and doubts. Raises LookupError on an unknown run."""
    _change(connection, run_key, state=state, cycles=cycles, sent_cycles=sent_cycles, doubts=doubts)


def _change(connection: Connection, run_key: int, **fields: object) -> None:
    if not amend(connection, run, [run.c.run_key == run_key], **_stored.columns(**fields)):
        raise LookupError(f"run {run_key} is not stored")
