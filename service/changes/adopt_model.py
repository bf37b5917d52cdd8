"""Adopting what a diagnosis found: from then on a clutch is tracked under the extended model, until it is rebuilt.

An adopted model belongs to the life that was diagnosed. All is computed again before the database is locked; the version is
stored with its results, under the revision that they were computed from.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection

from service import repository
from service.clutch.model_correction import extension_of
from service.clutch.recomputation import Adoption, ClutchHistory, Results
from service.errors import NothingToAdoptError
from storage import assumptions, changes, clutches, diagnoses, jobs
from storage.assumptions import AdoptedRow
from storage.diagnoses import DiagnosisRow
from storage.engine.database import Database


def adopt(database: Database, clutch_id: str, diagnosis_id: str | None, adopted_at: str, by: str = "local") -> None:
    """Adopt a diagnosis's extension, or return to the baseline, in the name of `by`; the clutch is then tracked again.

    What is in force already stays and makes no version. Raises NotFoundError for an unknown clutch or diagnosis,
    NothingToAdoptError where there is nothing to adopt or another life was diagnosed; then nothing was written.
    """
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        diagnosed = None if diagnosis_id is None else repository.diagnosis(connection, clutch_id, diagnosis_id)
        in_force = _in_force(connection, clutch_id, diagnosis_id)
        present_life = repository.present_life(connection, clutch_id)
    adoption = None if diagnosed is None else _adoptable(diagnosed)
    if in_force:
        if adoption is not None:
            _require_present(adoption, present_life)
        return
    _change(database, clutch_id, adoption, adopted_at=adopted_at, by=by)


def finish_and_adopt(
    database: Database,
    clutch_id: str,
    diagnosis_id: str,
    ended: Mapping[str, Any],
    at: str,
    by: str = "local",
    *,
    claimer: str,
) -> bool:
    """Store a finished diagnosis and adopt its extension in the same transaction; false, with nothing stored, if there
    is nothing to adopt.

    `ended` holds the diagnosis's `report` and `extension` (or None); `claimer` is the process that holds the job.
    """
    if ended["extension"] is None:
        return False
    with database.reading() as connection:
        life = repository.diagnosis(connection, clutch_id, diagnosis_id).life
    adoption = Adoption(diagnosis_id=diagnosis_id, life=life, extension=extension_of(ended["extension"]))

    def finish(connection: Connection) -> None:
        diagnosed = repository.diagnosis(connection, clutch_id, diagnosis_id)
        if changes.last_of_history(connection, clutch_id) > diagnosed.revision:
            raise NothingToAdoptError(f"runs have changed since diagnosis {diagnosis_id!r}: run a new diagnosis")
        if not jobs.end(connection, diagnosis_id, jobs.FINISHED, at, claimer=claimer):
            raise NothingToAdoptError(f"diagnosis {diagnosis_id!r} was cancelled: run a new diagnosis")
        diagnoses.finish(connection, diagnosis_id, at, ended["report"], ended["extension"])

    try:
        _change(database, clutch_id, adoption, adopted_at=at, by=by, before=finish)
    except NothingToAdoptError:  # a rebuild or a correction came meanwhile, or the diagnosis is no longer the claimer's
        return False
    return True


def _change(
    database: Database,
    clutch_id: str,
    adoption: Adoption | None,
    *,
    adopted_at: str,
    by: str,
    before: Callable[[Connection], None] | None = None,
) -> None:
    """Compute results under the new model and store them; repeat if the clutch was changed meanwhile."""
    diagnosis_id = None if adoption is None else adoption.diagnosis_id
    for _ in repository.attempts(clutch_id):
        state, results = _computed(database, clutch_id, adoption)
        with database.writing(of=clutch_id) as connection:
            if not repository.unchanged(connection, clutch_id, state.revision):
                continue
            if _in_force(connection, clutch_id, diagnosis_id):  # the same request was stored while this one waited
                return
            if before is not None:
                before(connection)
            newest = assumptions.current_adoption(connection, clutch_id)
            version = 1 if newest is None else newest.version + 1
            row = AdoptedRow(version=version, diagnosis_id=diagnosis_id, adopted_at=adopted_at)
            assumptions.insert_adoption(connection, clutch_id, row)
            repository.store(connection, clutch_id, results)
            repository.note_dispute(connection, clutch_id)
            was = {"diagnosis_id": None if newest is None else newest.diagnosis_id}
            now = {"diagnosis_id": diagnosis_id}
            revision = clutches.bump_revision(connection, clutch_id)
            changes.insert(connection, clutch_id, changes.ADOPT, was, now, at=adopted_at, by=by, revision=revision)
            return


def _computed(database: Database, clutch_id: str, adoption: Adoption | None) -> tuple[ClutchHistory, Results]:
    """The clutch's results under the new model; raises NothingToAdoptError if the diagnosis is of another life."""
    extension = None if adoption is None else adoption.extension
    with database.reading() as connection:
        state = repository.state(connection, clutch_id, also=extension)
        levels, receipts = repository.levels(connection, clutch_id), repository.receipts(connection, clutch_id)
    if adoption is not None:
        _require_present(adoption, state.lives[-1].name if state.events else "")
    state = replace(state, adoptions=(adoption,))
    return state, repository.tracked_again(database, state, levels, receipts)


def _in_force(connection: Connection, clutch_id: str, diagnosis_id: str | None) -> bool:
    """Whether this diagnosis's model is the newest adopted one of the lives in the history; `diagnosis_id` None:
    whether the baseline is."""
    if diagnosis_id is None:
        newest = assumptions.current_adoption(connection, clutch_id)
        return newest is None or newest.diagnosis_id is None
    adoption = repository.adoption(connection, clutch_id)
    return adoption is not None and adoption.diagnosis_id == diagnosis_id


def _adoptable(row: DiagnosisRow) -> Adoption:
    """The model extension of a diagnosis. Raises NothingToAdoptError."""
    if row.extension is None:
        why = "has no report yet: wait for it" if row.report is None else "has no extended model that could be adopted"
        raise NothingToAdoptError(f"diagnosis {row.diagnosis_id!r} {why}")
    return Adoption(diagnosis_id=row.diagnosis_id, life=row.life, extension=extension_of(row.extension))


def _require_present(adoption: Adoption, life: str) -> None:
    """Raise NothingToAdoptError if a diagnosis is of an earlier life."""
    if adoption.life != life:
        raise NothingToAdoptError(
            f"diagnosis {adoption.diagnosis_id!r} is of the life before the last rebuild: run a new diagnosis"
        )
