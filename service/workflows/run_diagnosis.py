"""A diagnosis is asked for, and its end is stored."""

import secrets
from collections.abc import Mapping
from typing import Any

from service import records, stored_verdicts
from service.lives.history import lives_of
from service.settings import CODE_VERSION
from storage import changes, diagnoses
from storage.diagnoses import NewDiagnosis
from storage.engine.database import Database


def ask(database: Database, clutch_id: str, *, created_at: str) -> NewDiagnosis:
    """Store a diagnosis of all runs that are there now, to be run. Raises NotFoundError."""
    with database.writing() as connection:
        clutch = records.clutch(connection, clutch_id)
        lives = lives_of(records.events(connection, clutch_id))
        row = NewDiagnosis(
            clutch_id=clutch_id,
            diagnosis_id=secrets.token_hex(8),
            created_at=created_at,
            revision=clutch.revision,
            last_run_key=diagnoses.last_run_key(connection, clutch_id),
            life=lives[-1].name if lives else "",
            as_of_cycles=lives[-1].events[-1].cycles if lives else None,
            code_version=CODE_VERSION,
        )
        diagnoses.insert(connection, row)
    return row


def running(database: Database, clutch_id: str) -> str | None:
    """The id of the diagnosis that is running of the very runs that are there now. Raises NotFoundError."""
    with database.reading() as connection:
        records.clutch(connection, clutch_id)
        return diagnoses.running(
            connection,
            clutch_id,
            diagnoses.last_run_key(connection, clutch_id),
            since=changes.last_of_history(connection, clutch_id),
        )


def finish(database: Database, diagnosis_id: str, ended: Mapping[str, Any], *, at: str) -> None:
    """Store how a diagnosis ended: its `report` and `extension`, or its `problem`."""
    with database.writing() as connection:
        if "problem" in ended:
            diagnoses.fail(connection, diagnosis_id, at, ended["problem"])
        else:
            diagnoses.finish(connection, diagnosis_id, at, ended["report"], ended["extension"])
            stored_verdicts.note_dispute(connection, diagnoses.clutch_of(connection, diagnosis_id))


def fail_running(database: Database, problem: str, *, at: str) -> None:
    """Say of all diagnoses that an earlier service left running why they have no report."""
    with database.writing() as connection:
        diagnoses.fail_all(connection, at, problem)
