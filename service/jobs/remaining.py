"""Remaining useful life under the baseline and under an extension, before anything is adopted."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from models.diagnosis.campaign import StationaryRun
from models.diagnosis.extension import Extension
from service import records
from service.lives.adopted_model import Adopted
from service.lives.assumptions import Basis, basis_under
from service.lives.campaign import Stored
from service.lives.history import ByPressure, Life
from service.lives.model_correction import corrected, neighbours
from service.queries import views
from service.workflows.adopt_model import adopted
from storage import fits, runs
from storage.engine.database import Database

METHOD = "particle"


def before_and_after(
    database: Database, clutch_id: str, known: Stored, extension: Extension | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What the particle filter says of the life that was diagnosed, by both models; alike where there is no extension."""
    if known.life is None:
        return {}, {}
    with database.reading() as connection:
        clutch = records.clutch(connection, clutch_id)
        cofs = fits.cofs_of_clutch(connection, clutch_id)
        keys = {row.run_id: row.run_key for row in runs.in_order(connection, clutch_id)}
        others = neighbours(connection, clutch_id, known.life)
        baseline = basis_under(connection, clutch, Adopted())
        plain = _with_cofs(known.life, {run_id: cofs[key] for run_id, key in keys.items() if key in cofs})
        before = _foretold(clutch_id, plain, baseline, known)
        if extension is None:
            return before, before
        tests = [run for run in known.taken if isinstance(run, StationaryRun)]
        freed = corrected(extension, known.record, plain, others, tests)
        extended = _with_cofs(plain, {event.run_id: freed.get(event.run_id, event.cofs) for event in plain.events})
        model = adopted(extension, extended, known.record.geometry.to_model())
        return before, _foretold(clutch_id, extended, basis_under(connection, clutch, model), known)


def _with_cofs(life: Life, cofs: Mapping[str, ByPressure]) -> Life:
    return replace(life, events=tuple(replace(each, cofs=cofs.get(each.run_id, {})) for each in life.events))


def _foretold(clutch_id: str, life: Life, basis: Basis, known: Stored) -> dict[str, Any]:
    fraction = known.record.end_of_life.cof_fraction
    return views.foretell(clutch_id, life.events, basis, fraction, method=METHOD, pressure_bar=None, at_cycles=None)
