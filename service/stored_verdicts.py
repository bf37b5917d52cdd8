"""A clutch's newest finished diagnosis, whether it leaves data and model in dispute, and the state that follows."""

from dataclasses import replace
from typing import Any

from sqlalchemy import Connection

from service import records
from service.alarms import raising
from service.lives.condition import DISAGREES, state_of, top_line
from storage import clutches, verdicts
from storage.clutches import ClutchRow
from storage.verdicts import VerdictRow


def latest(connection: Connection, row: ClutchRow, verdict: VerdictRow | None) -> dict[str, Any] | None:
    """The newest finished diagnosis as it goes out; one of a life that a rebuild has ended is past."""
    if verdict is None:
        return None
    earlier = verdict.life != _present_life(connection, row)
    return {
        "diagnosis_id": verdict.diagnosis_id,
        "verdict": verdict.verdict,
        "causes": list(verdict.causes),
        "advice": {name: verdict.advice[0][name] for name in ("test", "separates")} if verdict.advice else None,
        "adoptable": verdict.adoptable and not earlier,
        "adopted": verdict.adopted and not earlier,
        "earlier_life": earlier,
    }


def state(connection: Connection, row: ClutchRow) -> dict[str, str]:
    """The clutch's state and why."""
    return state_of(row.summary, disputed=_disputed(connection, row), silent=row.silent)


def first_line(connection: Connection, row: ClutchRow, diagnosis: dict[str, Any] | None) -> dict[str, str]:
    """What stands first of the clutch: `headline` and `action`; `diagnosis` is its newest one as it goes out."""
    return top_line(row.summary, disputed=_disputed(connection, row), diagnosis=diagnosis, silent=row.silent)


def _disputed(connection: Connection, row: ClutchRow) -> bool:
    return row.disputed is not None and row.disputed == _present_life(connection, row)


def note_dispute(connection: Connection, clutch_id: str) -> None:
    """Note whether data and model are in dispute, and the state that follows: where a diagnosis has been finished, a model
    adopted or the baseline restored. A dispute stays noted of its life, and counts while that is the present one."""
    verdict = verdicts.newest(connection, [clutch_id]).get(clutch_id)
    disputed = None if verdict is None or verdict.adopted or verdict.verdict not in DISAGREES else verdict.life
    row = replace(records.clutch(connection, clutch_id), disputed=disputed)
    clutches.set_disputed(connection, clutch_id, disputed, state=state(connection, row)["name"])
    raising.evaluate(connection, clutch_id)


def _present_life(connection: Connection, row: ClutchRow) -> str:
    life: str | None = row.summary.get("life")  # what was stored by earlier releases does not hold it
    return records.present_life(connection, row.clutch_id) if life is None else life
