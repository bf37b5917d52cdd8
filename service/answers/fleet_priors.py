"""`/v1/fleet/priors`: the newest version of every fleet's prior."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from models.degradation.severity import SeverityBasis
from models.prognosis.criteria import FEWEST_SEVERITIES
from models.prognosis.ended_lives import ObservedLife, severity_exponent
from models.prognosis.fleet import FleetPrior
from service.api.base import schema_fields
from service.api.fleet import FleetPriorOut
from storage import assumptions
from storage.assumptions import FleetPriorRow
from storage.engine.database import Database

_KINDS = ("friction_material", "reaction_plate", "fluid", "origin")
_OWN = ("version", "created_at", "clutches", "ended_lives", "censored_lives")
COLUMNS = (*_KINDS, "severity", *_OWN)


def newest(database: Database) -> list[dict[str, Any]]:
    with database.reading() as connection:
        return [_item(row) for row in assumptions.current_fleet_priors(connection)]


def rows(payload: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for item in payload["items"]:
        yield (
            {name: item["kind"][name] for name in _KINDS}
            | {"severity": item["kind"]["severity"]["basis"]}
            | {name: item[name] for name in _OWN}
            | {"severity_exponent": (item["severity_exponent"] or {}).get("value")}
            | {f"{name}_median": spread["median"] for name, spread in item["population"].items()}
            | {f"{name}_sd": spread.get("sd", spread.get("log_sd")) for name, spread in item["population"].items()}
        )


def _item(row: FleetPriorRow) -> dict[str, Any]:
    """A prior as it goes out: medians, and the factor or share by which two thirds of the clutches stay within."""
    return schema_fields(
        FleetPriorOut,
        row,
        kind=row.fleet,
        clutches=len(row.members),
        members=list(row.members),
        population=_population(FleetPrior.from_dict(row.content)),
        ended_lives=len(row.content.get("ended", ())),
        censored_lives=len(row.content.get("censored", ())),
        severity_exponent=_severity_exponent(row),
    )


def _severity_exponent(row: FleetPriorRow) -> dict[str, float] | None:
    """The exponent q of life ∝ energy^-q by ended lives, with its deviation; None if they do not determine it."""
    lives = [ObservedLife.from_dict(stored) for stored in row.content.get("ended", ())]
    by_energy = [(life.end, life.energy) for life in lives if life.energy]
    if len(by_energy) < FEWEST_SEVERITIES or len({energy for _, energy in by_energy}) == 1:
        return None
    value, deviation = severity_exponent(*np.array(by_energy).T)
    severity = row.fleet["severity"]
    # ends are in cycles that are weighted by energy to this power already: the fit gives what is missing to q
    already_counted = severity["exponent"] if severity["basis"] == SeverityBasis.DISSIPATED_ENERGY else 0.0
    return {"value": value + already_counted, "sd": deviation}


def _population(prior: FleetPrior) -> Mapping[str, Any]:
    population: dict[str, Any] = {}
    for index, name in enumerate(("change", "scale_cycles", "exponent", "scatter")):
        middle, deviation = float(prior.mean[index]), math.sqrt(prior.scale[index, index])
        if name == "change":
            population[name] = {"median": middle, "sd": deviation}
        else:
            population[name] = {"median": math.exp(middle), "log_sd": deviation}
    return population
