"""The fleet's priors: learned from all clutches of a kind, kept by version, and the tracks brought up to date with them.

No clutch is tracked under what was learned from itself: for each clutch that taught a version there is the same version
learned from the others.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from sqlalchemy import Connection

from models.prognosis.criteria import FEWEST_TESTS_TO_LEARN
from models.prognosis.fleet import FleetPrior, Taught, population, taught
from service import records
from service.lives.assumptions import ALL_PRESSURES, Basis, basis_of, kind_of
from service.lives.history import Life, lives
from service.lives.tracks import CARRIED
from service.settings import CODE_VERSION
from service.workflows.replay import results
from service.workflows.update_tracks import retrack
from storage import clutches, fleet_priors, predictions
from storage.clutches import ClutchRow
from storage.encoding.json_text import Json, to_text
from storage.engine.database import Database
from storage.fleet_priors import NOBODY, FleetPriorRow

#: Fewer clutches than this are no fleet.
FEWEST_CLUTCHES = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """Clutches of a kind, and what the lives of each have taught."""

    kind: Json
    lessons: dict[str, list[Taught]] = field(default_factory=dict)

    def without(self, clutch_id: str = NOBODY) -> FleetPrior | None:
        """What all clutches but one have taught; None where too few are left."""
        left = [lessons for name, lessons in sorted(self.lessons.items()) if name != clutch_id]
        return population([each for lessons in left for each in lessons]) if len(left) >= FEWEST_CLUTCHES else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Refreshed:
    """What a refresh did: the newest versions, whether each is new, and the clutches whose answers have changed."""

    priors: tuple[dict[str, Any], ...]
    changed: tuple[str, ...]


def refresh(database: Database, *, now: str) -> Refreshed:
    """Learn every fleet's prior anew; one that says something else is a new version, and tracks are made anew."""
    found: dict[str, Fleet] = {}
    with database.reading() as connection:
        names = clutches.all_ids(connection)
    for clutch_id in names:
        with database.reading() as connection:
            kind, lessons = _lessons(connection, clutch_id)
        if lessons:
            found.setdefault(to_text(kind), Fleet(kind=kind)).lessons[clutch_id] = lessons
    fresh = []
    for fleet in found.values():
        with database.writing() as connection:
            if _stored_anew(connection, fleet, now):
                fresh.append(fleet.kind)
    changed = tuple(clutch_id for clutch_id in names if _brought_up(database, clutch_id))
    priors = [item | {"new": item["kind"] in fresh} for item in current(database)]
    return Refreshed(priors=tuple(priors), changed=changed)


def current(database: Database) -> list[dict[str, Any]]:
    """The newest version of every fleet's prior, in the public shape."""
    with database.reading() as connection:
        return [_item(row) for row in fleet_priors.all_current(connection)]


def _lessons(connection: Connection, clutch_id: str) -> tuple[Json, list[Taught]]:
    clutch = records.clutch(connection, clutch_id)
    basis = basis_of(connection, clutch)
    found = [_lesson(life, basis) for life in lives(records.events(connection, clutch_id))]
    return kind_of(records.record(clutch), basis.severity), [each for each in found if each is not None]


def _lesson(life: Life, basis: Basis) -> Taught | None:
    """What a life teaches, its ζ counted in standard cycles; None where it was tested too little."""
    series = life.pooled(basis)
    if len(series.measurements) < FEWEST_TESTS_TO_LEARN:
        return None
    unit = series.scale.severity.unit
    return taught([replace(each, progress=each.progress * unit) for each in series.measurements])


def _stored_anew(connection: Connection, fleet: Fleet, now: str) -> bool:
    """Store a fleet's prior and what it is without each of its clutches, where it is not what is stored already."""
    learned = fleet.without()
    known = fleet_priors.current(connection, fleet.kind)
    if learned is None or (known is not None and known.content == learned.to_dict()):
        return False
    members = tuple(sorted(fleet.lessons))
    version = 1 if known is None else known.version + 1
    for left_out in (NOBODY, *members):
        prior = fleet.without(left_out)
        if prior is not None:
            row = FleetPriorRow(
                fleet=fleet.kind,
                version=version,
                left_out=left_out,
                created_at=now,
                members=members,
                content=prior.to_dict(),
                code_version=CODE_VERSION,
            )
            fleet_priors.insert(connection, row)
    fleet_priors.forget_left_out(connection, fleet.kind, before=version)
    return True


def _brought_up(database: Database, clutch_id: str) -> bool:
    """Track a clutch anew where its stored predictions were made under another prior; whether its answers have changed."""
    with database.writing() as connection:
        clutch: ClutchRow = records.clutch(connection, clutch_id)
        last = predictions.at(connection, clutch_id, CARRIED[0], ALL_PRESSURES)
        if last is None or last.payload.get("prior") == dict(basis_of(connection, clutch).prior):
            return False
        before = results(connection, clutch_id)
        retrack(connection, clutch, records.events(connection, clutch_id))
        if results(connection, clutch_id) == before:
            return False
        clutches.bump_revision(connection, clutch_id)
        return True


def _item(row: FleetPriorRow) -> dict[str, Any]:
    """A prior as it goes out: medians, and the factor or share by which two thirds of the clutches stay within."""
    return {
        "kind": row.fleet,
        "version": row.version,
        "created_at": row.created_at,
        "clutches": len(row.members),
        "members": list(row.members),
        "population": _population(FleetPrior.from_dict(row.content)),
    }


def _population(prior: FleetPrior) -> Mapping[str, Any]:
    names: Sequence[str] = ("change", "scale_cycles", "exponent", "scatter")
    deviations = [math.sqrt(prior.scale[index, index]) for index in range(len(names))]
    found: dict[str, Any] = {}
    for index, name in enumerate(names):
        middle = float(prior.mean[index])
        if name == "change":
            found[name] = {"median": middle, "sd": deviations[index]}
        else:
            found[name] = {"median": math.exp(middle), "log_sd": deviations[index]}
    return found
