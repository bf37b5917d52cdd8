"""Adopting what a diagnosis found: from then on a clutch is tracked under the extended model, until it is rebuilt.

An adopted model belongs to the life that was diagnosed. Artefacts are taken off the plateaus of its tests before curves
are fitted for mean COF; the fits and receipts of the baseline stay as they are.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from sqlalchemy import Connection

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.extension import Extension
from models.prognosis.criteria import HORIZON
from service import records
from service.errors import NotFoundError, NothingToAdoptError
from service.lives.adopted_model import BASELINE, Adopted, Course
from service.lives.assumptions import ALL_PRESSURES
from service.lives.history import Event, Life, lives, reference_velocities
from service.lives.model_correction import corrected, neighbours, tests_of
from service.workflows.update_cofs import refresh_cofs
from service.workflows.update_tracks import retrack
from storage import adopted_models, clutches, diagnoses, runs
from storage.adopted_models import AdoptedRow
from storage.clutches import ClutchRow
from storage.diagnoses import DiagnosisRow
from storage.engine.database import Database

#: At so many cycles a course is looked at to see whether there is one.
_PROBES = 40


def adopt(connection: Connection, clutch_id: str, diagnosis_id: str | None, *, adopted_at: str) -> dict[str, Any]:
    """Adopt a diagnosis's extension, or return to the baseline; all is tracked anew. Returns the model as it is answered.

    What is in force already stays and makes no version. Raises NotFoundError for an unknown clutch or diagnosis,
    NothingToAdoptError where there is nothing to adopt or another life was diagnosed; then nothing was written.
    """
    clutch = records.clutch(connection, clutch_id)
    if diagnosis_id is not None:
        _require_adoptable(connection, clutch_id, diagnosis_id)
    last = adopted_models.current(connection, clutch_id)
    if (None if last is None else last.diagnosis_id) != diagnosis_id:
        version = 1 if last is None else last.version + 1
        row = AdoptedRow(version=version, diagnosis_id=diagnosis_id, adopted_at=adopted_at)
        adopted_models.adopt(connection, clutch_id, row)
        clutches.bump_revision(connection, clutch_id)
        retrack_all(connection, clutch)
    return _described(connection, clutch_id)


def _require_adoptable(connection: Connection, clutch_id: str, diagnosis_id: str) -> None:
    row = diagnoses.get(connection, clutch_id, diagnosis_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no diagnosis {diagnosis_id!r}")
    if row.extension is None:
        said = "has not finished" if row.report is None else "found nothing to adopt"
        raise NothingToAdoptError(f"diagnosis {diagnosis_id!r} {said}")
    if row.life != present_life(connection, clutch_id):
        raise NothingToAdoptError(f"diagnosis {diagnosis_id!r} is of a life that a rebuild has ended")


def model(database: Database, clutch_id: str) -> dict[str, Any]:
    """The model in force and all versions, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        return _described(connection, clutch_id)


def _described(connection: Connection, clutch_id: str) -> dict[str, Any]:
    rows = adopted_models.versions(connection, clutch_id)
    found = in_force(connection, clutch_id)
    return {
        "clutch_id": clutch_id,
        "model": _name(found),
        "version": rows[0].version if rows else 0,
        "diagnosis_id": None if found is None else found.diagnosis_id,
        "versions": [
            {
                "version": row.version,
                "diagnosis_id": row.diagnosis_id,
                "adopted_at": row.adopted_at,
                "model": _name(_diagnosis(connection, clutch_id, row)),
            }
            for row in rows
        ],
    }


def _name(row: DiagnosisRow | None) -> dict[str, Any]:
    """The model as answers name it."""
    if row is None or row.extension is None:
        return dict(BASELINE)
    return {"name": "extended", "effects": list(Extension.from_dict(row.extension).effects)}


def _diagnosis(connection: Connection, clutch_id: str, row: AdoptedRow | None) -> DiagnosisRow | None:
    if row is None or row.diagnosis_id is None:
        return None
    return diagnoses.get(connection, clutch_id, row.diagnosis_id)


def present_life(connection: Connection, clutch_id: str) -> str:
    """The name of the present life: the run_id of the rebuild that began it, "" where there was none."""
    found = [records.event(row, {}) for row in runs.rebuilds(connection, clutch_id)]
    return max(found, key=lambda event: (event.cycles, event.moment, event.run_id)).run_id if found else ""


def in_force(connection: Connection, clutch_id: str) -> DiagnosisRow | None:
    """The diagnosis whose extension the present life is tracked under, None under the baseline."""
    found = _diagnosis(connection, clutch_id, adopted_models.current(connection, clutch_id))
    return found if found is not None and found.life == present_life(connection, clutch_id) else None


def extension_of(connection: Connection, clutch_id: str) -> Extension | None:
    """The extension that the present life is tracked under, None under the baseline."""
    found = in_force(connection, clutch_id)
    return None if found is None or found.extension is None else Extension.from_dict(found.extension)


def retrack_all(connection: Connection, clutch: ClutchRow) -> list[Event]:
    """Take mean COFs anew over the protocol of each life, free them of the artefacts of the model in force, track anew.

    Returns the history, ordered.
    """
    geometry = records.record(clutch).geometry.to_model()
    events = correct_all(connection, clutch, refresh_cofs(connection, clutch.clutch_id, geometry))
    retrack(connection, clutch, events)
    return events


def correct_newest(connection: Connection, clutch: ClutchRow, events: Sequence[Event], newest: Event) -> Event:
    """Correct the stored test that comes last in the ordered history; returns it by its corrected mean COFs."""
    extension = extension_of(connection, clutch.clutch_id)
    if extension is None or newest.speed_range is None:
        return newest
    life = lives(events)[-1]
    tests = tests_of(connection, clutch.clutch_id, replace(life, events=(newest,)))
    known = neighbours(connection, clutch.clutch_id, life)
    cofs = corrected(extension, records.record(clutch), life, known, tests).get(newest.run_id)
    if cofs is None:
        return newest
    row = records.run(connection, clutch.clutch_id, newest.run_id)
    adopted_models.write_corrected(connection, row.run_key, cofs)
    return replace(newest, cofs=cofs)


def correct_all(connection: Connection, clutch: ClutchRow, events: Sequence[Event]) -> list[Event]:
    """Store the corrected mean COFs of the present life's tests; returns the ordered history by them."""
    adopted_models.clear_corrected(connection, clutch.clutch_id)
    extension = extension_of(connection, clutch.clutch_id)
    if extension is None or not events:
        return list(events)
    life = lives(events)[-1]
    known, tests = neighbours(connection, clutch.clutch_id, life), tests_of(connection, clutch.clutch_id, life)
    found = corrected(extension, records.record(clutch), life, known, tests)
    keys = {row.run_id: row.run_key for row in runs.in_order(connection, clutch.clutch_id)}
    for run_id, cofs in found.items():
        adopted_models.write_corrected(connection, keys[run_id], cofs)
    return [replace(event, cofs=found.get(event.run_id, event.cofs)) for event in events]


def present_model(connection: Connection, clutch_id: str) -> Adopted:
    """What tracking needs of the model in force."""
    extension = extension_of(connection, clutch_id)
    if extension is None:
        return Adopted()
    geometry = records.record(records.clutch(connection, clutch_id)).geometry.to_model()
    return adopted(extension, lives(records.events(connection, clutch_id))[-1], geometry)


def adopted(extension: Extension, life: Life, geometry: Geometry) -> Adopted:
    """What an extension changes in the tracking of a life."""
    return Adopted(
        model={"name": "extended", "effects": list(extension.effects)},
        course=course_of(extension, life, geometry),
        severity_exponent=extension.severity_exponent,
    )


def course_of(extension: Extension, life: Life, geometry: Geometry) -> Course | None:
    """Mean COF [m] that the effects of use add at cycles since new [m] at a pressure [Pa], 0 = the reference pressures.

    None where they add nothing at any of many cycles, or no test has set a reference yet.
    """
    if life.speed_range is None or not life.reference:
        return None
    # every fifth of the protocol's speeds: their mean is that of all of them to half a per cent of the course
    velocities = reference_velocities(life.speed_range, geometry)[2::5]
    reference = np.array(sorted(life.reference))

    @cache
    def added(cycles: tuple[float, ...], pressure: float) -> FloatArray:
        levels = np.array([pressure]) if pressure else reference
        per_cof = np.array([geometry.torque_per_cof(float(level)) for level in levels])
        since = np.maximum(np.array(cycles) - life.origin, 0.0)
        found = extension.course(since, levels, velocities)
        return np.asarray((found / per_cof).mean(axis=1), dtype=np.float64)

    if not added(tuple(np.concatenate([[0.0], np.geomspace(1.0, HORIZON, _PROBES)]).tolist()), ALL_PRESSURES).any():
        return None
    return lambda cycles, pressure: added(tuple(cycles.tolist()), pressure)  # asked for the same cycles at every run
