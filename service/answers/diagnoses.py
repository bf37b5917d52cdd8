"""`/diagnoses`: stored reports, and whether they are still current; `/model`: the adopted model."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, TypeVar

from sqlalchemy import Connection

from service import repository
from service.api.base import of_row
from service.api.diagnosis import DiagnosisListed, DiagnosisOut, DiagnosisPage, ModelOut, ModelVersion, PlanOut
from service.api.life import ModelName
from service.channels import whole
from service.clutch.assumptions import BASELINE
from service.clutch.diagnosis.report import EMPTY
from service.clutch.model_correction import extension_of
from service.paging import Part, by_key
from service.tables import Cells
from storage import assumptions, changes, diagnoses
from storage.assumptions import AdoptedRow
from storage.diagnoses import DiagnosisRow
from storage.engine.database import Database

if TYPE_CHECKING:
    from models.diagnosis.extension import Extension

Shape = TypeVar("Shape", bound=DiagnosisListed)
#: What a row says of a diagnosis.
_OF_ROW = (
    "diagnosis_id", "clutch_id", "status", "created_at", "finished_at", "revision", "problem", "code_version",
)  # fmt: skip


def diagnosis(database: Database, clutch_id: str, diagnosis_id: str) -> DiagnosisOut:
    """A diagnosis as sent to clients. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        return _items(connection, clutch_id, [repository.diagnosis(connection, clutch_id, diagnosis_id)], DiagnosisOut)[
            0
        ]


#: The columns of a plan as a table: a row a step.
PLAN_COLUMNS = (
    "test", "choice", "step", "kind", "pressures_bar", "speeds_rpm", "frequency_hz", "periods", "oil_temperature_c",
    "repeats", "cycles", "pause_hours", "minutes", "separates", "probability", "what",
)  # fmt: skip


def plan(database: Database, clutch_id: str, diagnosis_id: str) -> PlanOut:
    """The tests that a diagnosis advises, as a test protocol: alternatives, best first. Raises NotFoundError."""
    tests = [test for test in diagnosis(database, clutch_id, diagnosis_id).advice if test.steps]
    return PlanOut(clutch_id=clutch_id, diagnosis_id=diagnosis_id, relation="alternatives", tests=tests)


def plan_rows(protocol: PlanOut) -> Iterator[Cells]:
    """A test protocol as rows of a table; several numbers in one cell are separated by spaces."""
    for number, test in enumerate(protocol.tests, start=1):
        for place, step in enumerate(test.steps, start=1):
            lists = {
                name: " ".join(f"{value:g}" for value in getattr(step, name))
                for name in ("pressures_bar", "speeds_rpm")
            }
            choice = {"test": number, "choice": f"one of {len(protocol.tests)} is enough", "step": place}
            why = {"separates": " ".join(test.separates), "probability": test.probability, "what": test.test}
            yield choice | dict(step) | lists | why


def page(database: Database, clutch_id: str, part: Part) -> DiagnosisPage:
    """A page of diagnoses without their maps and loops, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = diagnoses.page(connection, clutch_id, limit=part.most, before=part.number)
        items = {item.diagnosis_id: item for item in _items(connection, clutch_id, rows, DiagnosisListed)}
    return part.of(DiagnosisPage, rows, by_key("diagnosis_key"), lambda row: items[row.diagnosis_id])


def _items(connection: Connection, clutch_id: str, rows: list[DiagnosisRow], shape: type[Shape]) -> list[Shape]:
    """Diagnoses of the given type: complete, or shortened for lists."""
    life = repository.present_life(connection, clutch_id)
    adoption = repository.adoption(connection, clutch_id)
    in_force = adoption.diagnosis_id if adoption is not None and adoption.life == life else None
    latest, changed = diagnoses.last_run_key(connection, clutch_id), changes.last_of_history(connection, clutch_id)
    items = []
    for row in rows:
        own = {
            "as_of_cycles": None if row.as_of_cycles is None else whole(row.as_of_cycles),
            "stale": latest > row.last_run_key or changed > row.revision,
            "earlier_life": row.life != life,
            "adoptable": row.extension is not None and row.life == life,
            "adopted": row.diagnosis_id == in_force,
        }
        fields = {name: getattr(row, name) for name in _OF_ROW} | own | dict(EMPTY) | (row.report or {})
        items.append(shape(**{name: value for name, value in fields.items() if name in shape.model_fields}))
    return items


def model(database: Database, clutch_id: str) -> ModelOut:
    """The model in force and all adopted versions, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        repository.clutch(connection, clutch_id)
        rows = assumptions.adoptions_of(connection, clutch_id)
        adoption = repository.adoption(connection, clutch_id)
        life = repository.present_life(connection, clutch_id)
        in_force = adoption if adoption is not None and adoption.life == life else None
        return ModelOut(
            clutch_id=clutch_id,
            model=_name(None if in_force is None else in_force.extension),
            version=rows[0].version if rows else 0,
            diagnosis_id=None if in_force is None else in_force.diagnosis_id,
            versions=[of_row(ModelVersion, row, model=_name(_extension(connection, clutch_id, row))) for row in rows],
        )


def _name(extension: Extension | None) -> ModelName:
    return BASELINE if extension is None else ModelName(name="extended", effects=list(extension.effects))


def _extension(connection: Connection, clutch_id: str, row: AdoptedRow) -> Extension | None:
    if row.diagnosis_id is None:
        return None
    diagnosed = diagnoses.get(connection, clutch_id, row.diagnosis_id)
    return None if diagnosed is None or diagnosed.extension is None else extension_of(diagnosed.extension)
