"""The tables of adopted models, with the mean COFs as they correct them, and of priors learned from fleets.

Priors are kept by kind of clutch, version, and the clutches that were left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from sqlalchemy import Connection, Select, bindparam, delete, func, select

from storage.dialects import json_length
from storage.encoding import Json, to_list, to_text
from storage.rows import Rows, allows_damage, refuse_damaged, sealed
from storage.tables import adopted_model, corrected_cof, fleet_prior, run

# --- adopted models ---

#: Mean COF, its deviation, and mean COF under each draw of the model in force.
CorrectedCof: TypeAlias = tuple[float, float, tuple[float, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class AdoptedRow:
    """An adopted model's version, from 1 on; `diagnosis_id` None: a return to the baseline."""

    version: int
    diagnosis_id: str | None
    adopted_at: str


_adoptions = Rows(AdoptedRow, of=adopted_model)
_corrected = (
    select(corrected_cof)
    .join(run, run.c.run_key == corrected_cof.c.run_key)
    .where(run.c.clutch_id == bindparam("of"), run.c.run_key > bindparam("beyond"))
    .order_by(corrected_cof.c.run_key, corrected_cof.c.pressure)
)


def _adopted(clutch_id: str) -> Select[Any]:
    """The adopted versions of a clutch, newest first."""
    of_clutch = select(adopted_model).where(adopted_model.c.clutch_id == clutch_id)
    return of_clutch.order_by(adopted_model.c.version.desc())


def current_adoption(connection: Connection, clutch_id: str) -> AdoptedRow | None:
    """The newest adopted version, None before the first."""
    return _adoptions.first(connection.execute(_adopted(clutch_id).limit(1)))


def adoptions_of(connection: Connection, clutch_id: str) -> list[AdoptedRow]:
    return _adoptions.all(connection.execute(_adopted(clutch_id)))


def insert_adoption(connection: Connection, clutch_id: str, row: AdoptedRow) -> None:
    """Store an adopted version. Raises IntegrityError where it is there or its diagnosis unknown."""
    connection.execute(adopted_model.insert(), _adoptions.values(row, clutch_id=clutch_id))


def corrected_cofs_of(connection: Connection, clutch_id: str, beyond: int = 0) -> dict[int, dict[float, CorrectedCof]]:
    """run_key -> pressure -> mean COF, its standard deviation, and mean COF under each draw, of the runs that the model
    in force corrects, with keys `beyond` that one."""
    cofs: dict[int, dict[float, CorrectedCof]] = {}
    rows = connection.execute(_corrected, {"of": clutch_id, "beyond": beyond})
    damage_allowed = allows_damage(rows, corrected_cof)
    for row in rows.mappings():
        if not damage_allowed:
            refuse_damaged(corrected_cof, dict(row))
        draws = tuple(to_list(row["mean_cof_draws"] or "[]"))
        cofs.setdefault(row["run_key"], {})[row["pressure"]] = (row["mean_cof"], row["mean_cof_sd"], draws)
    return cofs


def write_corrected_cofs(connection: Connection, run_key: int, cofs: Mapping[float, CorrectedCof]) -> None:
    """Replace a run's corrected mean COFs by pressure."""
    connection.execute(delete(corrected_cof).where(corrected_cof.c.run_key == run_key))
    names = ("run_key", "pressure", "mean_cof", "mean_cof_sd", "mean_cof_draws")
    rows = [(run_key, pressure, mean, sd, to_text(list(draws))) for pressure, (mean, sd, draws) in cofs.items()]
    if rows:
        values = [sealed(corrected_cof, dict(zip(names, row, strict=True))) for row in rows]
        connection.execute(corrected_cof.insert(), values)


def clear_corrected_cofs(connection: Connection, clutch_id: str) -> None:
    runs_of_clutch = select(run.c.run_key).where(run.c.clutch_id == clutch_id)
    connection.execute(delete(corrected_cof).where(corrected_cof.c.run_key.in_(runs_of_clutch)))


# --- fleet priors ---

#: Learned from all clutches of the kind.
NOBODY = ""
#: The clutches of a large fleet are left out in so many groups: a prior for each of a thousand would take hours to learn,
#: and a thousand times the room. Chosen: 19 of 20 clutches teach nearly what all of them do; ten would do.
_GROUPS = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetPriorRow:
    """A prior: `fleet` is the kind of clutch, `left_out` the clutch not learned from, or NOBODY; of a group left out
    together (`groups`), its first clutch."""

    fleet: Json
    version: int
    left_out: str
    created_at: str
    members: tuple[str, ...]
    content: Json
    code_version: str


_priors = Rows(FleetPriorRow, of=fleet_prior)
_from_all = fleet_prior.c.left_out == NOBODY
_fleet_newest = (
    select(fleet_prior.c.fleet, func.max(fleet_prior.c.version).label("version"))
    .where(_from_all)
    .group_by(fleet_prior.c.fleet)
    .subquery()
)
_fleet_all_current = (
    select(fleet_prior)
    .join(
        _fleet_newest,
        (fleet_prior.c.fleet == _fleet_newest.c.fleet) & (fleet_prior.c.version == _fleet_newest.c.version),
    )
    .where(_from_all)
    .order_by(fleet_prior.c.fleet)
)
_fleet_ended_lives = _fleet_all_current.with_only_columns(
    func.coalesce(func.sum(json_length(fleet_prior.c.content, "ended")), 0)
).order_by(None)


def insert_fleet_prior(connection: Connection, row: FleetPriorRow) -> None:
    """Store a prior. Raises IntegrityError if this version is stored already."""
    connection.execute(fleet_prior.insert(), _priors.values(row, fleet=fleet_key(row.fleet)))


def current_fleet_prior(connection: Connection, fleet: Json) -> FleetPriorRow | None:
    """The newest prior of a kind of clutch, learned from all its clutches; None before the first."""
    return _priors.first(connection.execute(_versions(fleet).limit(1)))


def _versions(fleet: Json) -> Select[Any]:
    """The versions of a kind's prior learned from all its clutches, newest first."""
    of_fleet = select(fleet_prior).where(fleet_prior.c.fleet == fleet_key(fleet), _from_all)
    return of_fleet.order_by(fleet_prior.c.version.desc())


def groups(members: Sequence[str]) -> list[Sequence[str]]:
    """The clutches of a fleet in ascending order, in groups that are left out together; with few clutches each is a
    group."""
    return [members[first::_GROUPS] for first in range(min(_GROUPS, len(members)))]


def fleet_prior_for(connection: Connection, fleet: Json, clutch_id: str, version: int | None) -> FleetPriorRow | None:
    """The prior for a clutch, learned without it, in that version (None or deleted: the newest; 0: none).

    None if there is none, or if too few other clutches were left.
    """
    if version == 0:
        return None
    versions = _versions(fleet).with_only_columns(fleet_prior.c.version, fleet_prior.c.members).limit(1)
    wanted = versions.where(fleet_prior.c.version == version)
    version_row = connection.execute(wanted).first() or connection.execute(versions).first()
    if version_row is None:
        return None
    members = to_list(version_row.members)
    left_out = members[members.index(clutch_id) % _GROUPS] if clutch_id in members else NOBODY
    of_version = (fleet_prior.c.fleet == fleet_key(fleet), fleet_prior.c.version == version_row.version)
    query = select(fleet_prior).where(*of_version, fleet_prior.c.left_out == left_out)
    return _priors.first(connection.execute(query))


def current_fleet_priors(connection: Connection) -> list[FleetPriorRow]:
    return _priors.all(connection.execute(_fleet_all_current))


def count_ended_lives(connection: Connection) -> int:
    """The number of ended lives in the newest priors of all kinds."""
    return int(connection.execute(_fleet_ended_lives).scalar_one())


def forget_left_out(connection: Connection, fleet: Json, *, before: int) -> None:
    """Delete the priors learned without a clutch in versions before `before`; priors learned from all clutches stay."""
    of_fleet = delete(fleet_prior).where(fleet_prior.c.fleet == fleet_key(fleet), fleet_prior.c.version < before)
    connection.execute(of_fleet.where(~_from_all))


def fleet_key(fleet: Json) -> str:
    return to_text(dict(sorted(fleet.items())))
