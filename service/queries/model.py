"""`/model`: the model that a clutch is tracked under, and all versions that were adopted."""

from typing import Any

from sqlalchemy import Connection

from models.diagnosis.extension import Extension
from service import records
from service.lives.assumptions import BASELINE
from storage import assumptions, diagnoses
from storage.assumptions import AdoptedRow
from storage.engine.database import Database


def model(database: Database, clutch_id: str) -> dict[str, Any]:
    """The model in force and all versions, newest first. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        rows = assumptions.adoptions_of(connection, clutch_id)
        adoption = records.adoption(connection, clutch_id)
        life = records.present_life(connection, clutch_id)
        in_force = adoption if adoption is not None and adoption.life == life else None
        return {
            "clutch_id": clutch_id,
            "model": _name(None if in_force is None else in_force.extension),
            "version": rows[0].version if rows else 0,
            "diagnosis_id": None if in_force is None else in_force.diagnosis_id,
            "versions": [
                {
                    "version": row.version,
                    "diagnosis_id": row.diagnosis_id,
                    "adopted_at": row.adopted_at,
                    "model": _name(_extension(connection, clutch_id, row)),
                }
                for row in rows
            ],
        }


def _name(extension: Extension | None) -> dict[str, Any]:
    """The model as answers name it."""
    return dict(BASELINE) if extension is None else {"name": "extended", "effects": list(extension.effects)}


def _extension(connection: Connection, clutch_id: str, row: AdoptedRow) -> Extension | None:
    if row.diagnosis_id is None:
        return None
    diagnosed = diagnoses.get(connection, clutch_id, row.diagnosis_id)
    return None if diagnosed is None or diagnosed.extension is None else Extension.from_dict(diagnosed.extension)
