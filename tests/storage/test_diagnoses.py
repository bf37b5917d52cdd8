"""Diagnoses: each function against a real database."""

import pytest

from storage import diagnoses
from storage.diagnoses import FAILED, FINISHED, RUNNING
from storage.engine.database import Database
from tests.storage.samples import store_diagnoses

CLUTCH = "bench3-017"


@pytest.fixture
def stocked(database: Database) -> Database:
    return store_diagnoses(database)


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
