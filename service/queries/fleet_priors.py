"""`/v1/fleet/priors`: the newest version of every fleet's prior."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from models.prognosis.fleet import FleetPrior
from storage import assumptions
from storage.assumptions import FleetPriorRow
from storage.engine.database import Database

_KINDS, _OWN = ("friction_material", "reaction_plate", "fluid", "origin"), ("version", "created_at", "clutches")
COLUMNS = (*_KINDS, "severity", *_OWN)


def newest(database: Database) -> list[dict[str, Any]]:
    """The newest version of every fleet's prior, in the public shape."""
    with database.reading() as connection:
        return [_item(row) for row in assumptions.current_fleet_priors(connection)]


def rows(items: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """The priors as rows of a table."""
    for item in items:
        yield (
            {name: item["kind"][name] for name in _KINDS}
            | {"severity": item["kind"]["severity"]["basis"]}
            | {name: item[name] for name in _OWN}
            | {f"{name}_median": spread["median"] for name, spread in item["population"].items()}
            | {f"{name}_sd": spread.get("sd", spread.get("log_sd")) for name, spread in item["population"].items()}
        )


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
    population: dict[str, Any] = {}
    for index, name in enumerate(names):
        middle = float(prior.mean[index])
        if name == "change":
            population[name] = {"median": middle, "sd": deviations[index]}
        else:
            population[name] = {"median": math.exp(middle), "log_sd": deviations[index]}
    return population
