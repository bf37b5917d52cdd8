"""`/v1/fleet/priors`: the newest version of every fleet's prior."""

import math
from collections.abc import Iterator

import numpy as np

from models.degradation.severity import SeverityBasis
from models.prognosis.criteria import FEWEST_SEVERITIES
from models.prognosis.ended_lives import ObservedLife, severity_exponent
from models.prognosis.fleet import FleetPrior
from service.api.base import of_row
from service.api.fleet import Factor, FleetPriorOut, FleetPriorPage, Population, SeverityEstimate, Share
from service.paging import Part
from service.tables import Cells, cells
from storage import assumptions
from storage.assumptions import FleetPriorRow
from storage.engine.database import Database

_KINDS = ("friction_material", "reaction_plate", "fluid", "origin")
_OWN = ("version", "created_at", "clutches", "ended_lives", "censored_lives")
COLUMNS = (*_KINDS, "severity", *_OWN)


def page(database: Database, part: Part) -> FleetPriorPage:
    """A page of the newest version of every prior."""
    with database.reading() as connection:
        priors = part.sliced([_item(row) for row in assumptions.current_fleet_priors(connection)])
    return FleetPriorPage(items=[*priors.items], next=priors.next)


def rows(page: FleetPriorPage) -> Iterator[Cells]:
    """Priors as rows of a table."""
    for item in page.items:
        population: dict[str, Share | Factor] = dict(item.population)
        yield (
            cells(item.kind, _KINDS)
            | {"severity": item.kind.severity.basis}
            | cells(item, _OWN)
            | {"severity_exponent": None if item.severity_exponent is None else item.severity_exponent.value}
            | {f"{name}_median": spread.median for name, spread in population.items()}
            | {
                f"{name}_sd": spread.sd if isinstance(spread, Share) else spread.log_sd
                for name, spread in population.items()
            }
        )


def _item(row: FleetPriorRow) -> FleetPriorOut:
    """A prior as sent to clients: medians, and the factor or share within which two thirds of the clutches lie."""
    return of_row(
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


def _severity_exponent(row: FleetPriorRow) -> SeverityEstimate | None:
    """The exponent q of life ∝ energy^-q from ended lives, with its standard deviation; None if they do not determine
    it."""
    lives = [ObservedLife.from_dict(stored) for stored in row.content.get("ended", ())]
    by_energy = [(life.end, life.energy) for life in lives if life.energy]
    if len(by_energy) < FEWEST_SEVERITIES or len({energy for _, energy in by_energy}) == 1:
        return None
    value, deviation = severity_exponent(*np.array(by_energy).T)
    severity = row.fleet["severity"]
    # ends are in cycles that are weighted by energy to this power already: the fit gives what is missing to q
    already_counted = severity["exponent"] if severity["basis"] == SeverityBasis.DISSIPATED_ENERGY else 0.0
    return SeverityEstimate(value=value + already_counted, sd=deviation)


def _population(prior: FleetPrior) -> Population:
    change, *others = zip(prior.mean.tolist(), np.sqrt(np.diag(prior.scale)).tolist(), strict=False)
    scale_cycles, exponent, scatter = (Factor(median=math.exp(middle), log_sd=sd) for middle, sd in others[:3])
    share = Share(median=change[0], sd=change[1])
    return Population(change=share, scale_cycles=scale_cycles, exponent=exponent, scatter=scatter)
