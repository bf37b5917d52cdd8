"""Diagnoses, adopted models and what these correct; and the step that brings an older file to them."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from alembic import command
from sqlalchemy.exc import IntegrityError

from storage import adopted_models, clutches, diagnoses, runs
from storage.adopted_models import AdoptedRow
from storage.diagnoses import FAILED, FINISHED, RUNNING, NewDiagnosis
from storage.engine.database import Database, open_database
from storage.migrations import upgrade as migrations
from tests.storage.samples import clutch_row, integrity, new_run, store_run

CLUTCH = "bench3-017"


def new_diagnosis(number: int, *, last_run_key: int = 1) -> NewDiagnosis:
    return NewDiagnosis(
        clutch_id=CLUTCH,
        diagnosis_id=f"d{number}",
        created_at="2026-11-02T10:00:00+00:00",
        revision=3,
        last_run_key=last_run_key,
        life="",
        as_of_cycles=None if number % 2 else 1000.0,
        code_version="0.1.0",
    )


@pytest.fixture
def stocked(database: Database) -> Database:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        store_run(connection, 1)
        for number in range(3):
            diagnoses.insert(connection, new_diagnosis(number))
    return database


def test_a_diagnosis_runs_and_ends_once(stocked: Database) -> None:
    with stocked.writing() as connection:
        row = diagnoses.get(connection, CLUTCH, "d0")
        assert row is not None
        assert (row.status, row.report, row.as_of_cycles, row.last_run_key) == (RUNNING, None, 1000.0, 1)
        assert diagnoses.finish(connection, "d0", "later", {"verdict": "model_adequate"}, {"effects": []})
        assert not diagnoses.fail(connection, "d0", "later still", "too late")
        assert diagnoses.fail(connection, "d1", "later", "it broke")
        found = {row.diagnosis_id: row for row in diagnoses.page(connection, CLUTCH, limit=10)}
    assert list(found) == ["d2", "d1", "d0"]
    assert (found["d0"].status, found["d0"].report) == (FINISHED, {"verdict": "model_adequate"})
    assert found["d0"].extension == {"effects": []}
    assert (found["d1"].status, found["d1"].problem, found["d1"].report) == (FAILED, "it broke", None)
    assert (found["d2"].status, found["d2"].finished_at) == (RUNNING, None)


def test_what_was_left_running_ends_at_once(stocked: Database) -> None:
    with stocked.writing() as connection:
        diagnoses.finish(connection, "d0", "later", {}, None)
        assert diagnoses.fail_all(connection, "now", "interrupted") == 2
        assert diagnoses.fail_all(connection, "now", "interrupted") == 0
        assert [row.status for row in diagnoses.page(connection, CLUTCH, limit=10)] == [FAILED, FAILED, FINISHED]


def test_pages_and_the_one_that_runs(stocked: Database) -> None:
    with stocked.writing() as connection:
        first = diagnoses.page(connection, CLUTCH, limit=2)
        rest = diagnoses.page(connection, CLUTCH, limit=2, before=first[-1].diagnosis_key)
        assert [row.diagnosis_id for row in (*first, *rest)] == ["d2", "d1", "d0"]
        assert diagnoses.running(connection, CLUTCH, 1) == "d0"
        assert diagnoses.running(connection, CLUTCH, 2) is None
        assert diagnoses.running(connection, "another", 1) is None
        assert diagnoses.last_run_key(connection, CLUTCH) == 1
        assert diagnoses.last_run_key(connection, "another") == 0
        assert diagnoses.get(connection, "another", "d0") is None


def test_nothing_that_json_cannot_carry_is_stored(stocked: Database) -> None:
    with stocked.writing() as connection, pytest.raises(ValueError, match="not JSON compliant"):
        diagnoses.finish(connection, "d0", "later", {"rmse": float("nan")}, None)


def test_models_are_kept_by_version(stocked: Database) -> None:
    with stocked.writing() as connection:
        assert adopted_models.current(connection, CLUTCH) is None
        rows = [
            AdoptedRow(version=1, diagnosis_id="d0", adopted_at="then"),
            AdoptedRow(version=2, diagnosis_id=None, adopted_at="now"),
        ]
        for row in rows:
            adopted_models.adopt(connection, CLUTCH, row)
        assert adopted_models.current(connection, CLUTCH) == rows[1]
        assert adopted_models.versions(connection, CLUTCH) == rows[::-1]
        assert adopted_models.versions(connection, "another") == []


def test_a_model_of_no_diagnosis_is_refused(stocked: Database) -> None:
    row = AdoptedRow(version=1, diagnosis_id="nothing", adopted_at="then")
    with pytest.raises(IntegrityError), stocked.writing() as connection:
        adopted_models.adopt(connection, CLUTCH, row)


def test_corrections_stand_beside_the_fits(stocked: Database) -> None:
    cofs = {4e5: (0.12, 0.001), 5e5: (0.11, 0.002)}
    with stocked.writing() as connection:
        adopted_models.write_corrected(connection, 1, cofs)
        assert adopted_models.corrected_cofs(connection, CLUTCH) == {1: cofs}
        adopted_models.write_corrected(connection, 1, {4e5: (0.13, 0.001)})
        assert adopted_models.corrected_cofs(connection, CLUTCH) == {1: {4e5: (0.13, 0.001)}}
        assert adopted_models.corrected_cofs(connection, "another") == {}
        adopted_models.clear_corrected(connection, "another")
        assert adopted_models.corrected_cofs(connection, CLUTCH)
        adopted_models.clear_corrected(connection, CLUTCH)
        assert adopted_models.corrected_cofs(connection, CLUTCH) == {}


def test_an_older_file_is_brought_up_and_keeps_what_it_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "old.db"
    whole = command.upgrade
    monkeypatch.setattr(command, "upgrade", lambda config, _: whole(config, "s0001_first_tables"))
    with closing(open_database(f"sqlite:///{path}")) as old, old.writing() as connection:
        clutches.insert(connection, clutch_row())
        runs.insert(connection, new_run(1))
    monkeypatch.undo()
    with closing(sqlite3.connect(path)) as connection:
        names = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        assert "diagnosis" not in names
        assert connection.execute("SELECT version_num FROM alembic_version").fetchall() == [("s0001_first_tables",)]
    with closing(open_database(f"sqlite:///{path}")) as new, new.writing() as connection:
        assert migrations.current(connection) == migrations.head()
        assert clutches.get(connection, CLUTCH) == clutch_row()
        assert [row.run_id for row in runs.page(connection, CLUTCH)] == ["run-0001"]
        diagnoses.insert(connection, new_diagnosis(0))
        assert diagnoses.running(connection, CLUTCH, 1) == "d0"
    assert integrity(path) == ["ok"]
