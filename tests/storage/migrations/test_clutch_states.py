"""A database of an earlier release, of either kind, is brought to states, searches and indexes with what it holds."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from typing import Any

import pytest
import sqlalchemy as sa

from storage import assumptions, clutches, diagnoses, runs
from storage.assumptions import AdoptedRow
from storage.clutches import Choice
from storage.engine.opening import open_database
from storage.migrations import upgrade as migrations
from tests.storage.engine.postgresql.server import PostgresServer
from tests.storage.samples import clutch_row, new_diagnosis, new_run, take_back

BEFORE = "s0009_raw_stores"
AT = "2026-11-02T10:00:00+00:00"


@pytest.fixture(params=["file", "server"])
def address(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    if request.param == "file":
        return f"sqlite:///{tmp_path_factory.mktemp('older') / 'a.db'}"
    server: PostgresServer = request.getfixturevalue("postgresql")
    return server.fresh()


def summary(status: str = "predicted", health: float | None = 0.5, **more: Any) -> dict[str, Any]:
    return {"status": status, "current": {"health": health}, "remaining_cycles": {"0.5": 1.0}} | more


def as_before(address: str, fill: Callable[[sa.Connection], None]) -> None:
    """A database as the release before left it, filled."""
    with closing(open_database(address)) as database, database.writing() as connection:
        fill(connection)
        take_back(connection, BEFORE)


def diagnosed(connection: sa.Connection, clutch_id: str, verdict: str, *, life: str = "", number: int = 0) -> str:
    row = replace(new_diagnosis(number), clutch_id=clutch_id, diagnosis_id=f"{clutch_id}-{number}", life=life)
    diagnoses.insert(connection, row)
    diagnoses.finish(connection, row.diagnosis_id, AT, {"verdict": verdict, "causes": []}, None)
    return row.diagnosis_id


def fill(connection: sa.Connection) -> None:
    for clutch_id, shown in (
        ("empty", {}),
        ("young", summary("insufficient_data", None)),
        ("ended", summary("reached", -0.1, life="")),
        ("low", summary(health=0.1, life="")),
        ("fine", summary(life="")),
        ("never", summary("may_never_reach", None, life="")),
        ("named", summary(health=0.1, life="")),
        ("named-and-ended", summary("reached", 0.0, life="")),
        ("adequate-since", summary(life="")),
        ("adopted", summary(life="")),
        ("back-to-baseline", summary(life="")),
        ("rebuilt-since", summary(life="again")),
        ("old-named", summary()),
        ("old-rebuilt-since", summary()),
    ):
        record = {"clutch_id": clutch_id, "friction_material": "Paper", "fluid": "ÖL"}
        clutches.insert(connection, replace(clutch_row(clutch_id), summary=shown, record=record))
    for clutch_id in ("named", "named-and-ended", "adequate-since", "rebuilt-since", "old-named", "old-rebuilt-since"):
        diagnosed(connection, clutch_id, "cause_named")
    diagnosed(connection, "adequate-since", "model_adequate", number=1)
    for clutch_id in ("adopted", "back-to-baseline"):
        diagnosis_id = diagnosed(connection, clutch_id, "cause_ambiguous")
        assumptions.insert_adoption(
            connection, clutch_id, AdoptedRow(version=1, diagnosis_id=diagnosis_id, adopted_at=AT)
        )
    assumptions.insert_adoption(connection, "back-to-baseline", AdoptedRow(version=2, diagnosis_id=None, adopted_at=AT))
    rebuild = replace(new_run(1, clutch_id="old-rebuilt-since"), kind="maintenance", details={"event": "rebuild"})
    runs.insert(connection, rebuild)


STATES = {
    "empty": ("check", None),
    "young": ("check", None),
    "ended": ("failure", None),
    "low": ("maintenance", None),
    "fine": ("normal", None),
    "never": ("normal", None),
    "named": ("out_of_specification", ""),
    "named-and-ended": ("failure", ""),
    "adequate-since": ("normal", None),
    "adopted": ("normal", None),
    "back-to-baseline": ("out_of_specification", ""),
    "rebuilt-since": ("normal", ""),
    "old-named": ("out_of_specification", ""),
    "old-rebuilt-since": ("normal", ""),
}


def test_clutches_of_an_earlier_release_are_in_the_states_that_their_pages_showed(address: str) -> None:
    as_before(address, fill)
    with closing(open_database(address)) as database, database.reading() as connection:
        assert migrations.current(connection) == migrations.head()
        rows = clutches.page(connection, limit=99, by_name=True)
        assert {row.clutch_id: (row.state, row.disputed) for row in rows} == STATES
        assert len(clutches.page(connection, Choice(find="öl"), limit=99)) == len(STATES)
        assert [row.clutch_id for row in clutches.page(connection, Choice(find="BACK-"), limit=9)] == [
            "back-to-baseline"
        ]
        indexes = {index["name"]: index["column_names"] for index in sa.inspect(connection).get_indexes("clutch")}
    assert indexes["clutch_worst_first"] == ["archived", "rank", "clutch_id"]
    assert indexes["clutch_by_state"] == ["archived", "state", "rank", "clutch_id"]
