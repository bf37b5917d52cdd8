"""The priors learned from fleets, by kind of clutch, version, and the clutch that was left out."""

from dataclasses import dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, Row, bindparam, delete, func, select

from storage.encoding.json_text import Json, to_list, to_object, to_text
from storage.tables import fleet_prior

#: Learned from all clutches of the kind.
NOBODY = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetPriorRow:
    """A prior: `fleet` is the kind of clutch, `left_out` the clutch that was not learned from, or NOBODY."""

    fleet: Json
    version: int
    left_out: str
    created_at: str
    members: tuple[str, ...]
    content: Json
    code_version: str


_insert = sa.insert(fleet_prior)
_current = (
    select(fleet_prior)
    .where(fleet_prior.c.fleet == bindparam("of_fleet"), fleet_prior.c.left_out == NOBODY)
    .order_by(fleet_prior.c.version.desc())
    .limit(1)
)
_without = select(fleet_prior).where(
    fleet_prior.c.fleet == bindparam("of_fleet"),
    fleet_prior.c.version == bindparam("of_version"),
    fleet_prior.c.left_out == bindparam("wanted"),
)
_newest = (
    select(fleet_prior.c.fleet, func.max(fleet_prior.c.version).label("version"))
    .where(fleet_prior.c.left_out == NOBODY)
    .group_by(fleet_prior.c.fleet)
    .subquery()
)
_all_current = (
    select(fleet_prior)
    .join(_newest, (fleet_prior.c.fleet == _newest.c.fleet) & (fleet_prior.c.version == _newest.c.version))
    .where(fleet_prior.c.left_out == NOBODY)
    .order_by(fleet_prior.c.fleet)
)
_forget = delete(fleet_prior).where(
    fleet_prior.c.fleet == bindparam("of_fleet"),
    fleet_prior.c.version < bindparam("before"),
    fleet_prior.c.left_out != NOBODY,
)


def insert(connection: Connection, row: FleetPriorRow) -> None:
    """Store a prior. Raises IntegrityError where this version is there."""
    values = {
        "fleet": _key(row.fleet),
        "version": row.version,
        "left_out": row.left_out,
        "created_at": row.created_at,
        "members": to_text(row.members),
        "content": to_text(row.content),
        "code_version": row.code_version,
    }
    connection.execute(_insert, values)


def current(connection: Connection, fleet: Json) -> FleetPriorRow | None:
    """The newest version of a kind of clutch, learned from all of them; None before the first."""
    row = connection.execute(_current, {"of_fleet": _key(fleet)}).first()
    return None if row is None else _row(row)


def without(connection: Connection, prior: FleetPriorRow, clutch_id: str) -> FleetPriorRow | None:
    """The same version learned from all but one clutch; None where too few were left."""
    values = {"of_fleet": _key(prior.fleet), "of_version": prior.version, "wanted": clutch_id}
    row = connection.execute(_without, values).first()
    return None if row is None else _row(row)


def all_current(connection: Connection) -> list[FleetPriorRow]:
    """The newest version of every kind of clutch."""
    return [_row(row) for row in connection.execute(_all_current)]


def forget_left_out(connection: Connection, fleet: Json, *, before: int) -> None:
    """Drop the priors with a clutch left out of all versions before `before`; those learned from all clutches stay."""
    connection.execute(_forget, {"of_fleet": _key(fleet), "before": before})


def _key(fleet: Json) -> str:
    return to_text(dict(sorted(fleet.items())))


def _row(row: Row[tuple[object, ...]]) -> FleetPriorRow:
    values = row._asdict()
    values["fleet"] = to_object(values["fleet"])
    values["members"] = tuple(to_list(values["members"]))
    values["content"] = to_object(values["content"])
    return FleetPriorRow(**values)
