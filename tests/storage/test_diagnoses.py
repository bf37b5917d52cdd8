"""Diagnoses, and the models that were adopted of them."""

import pytest
from sqlalchemy.exc import IntegrityError

from storage import assumptions, clutches, diagnoses
from storage.assumptions import AdoptedRow
from storage.clutches import ClutchRow
from storage.diagnoses import FAILED, FINISHED, RUNNING, NewDiagnosis, VerdictRow
from storage.engine.database import Database
from tests.storage.samples import store_diagnoses

# --- Diagnoses, and the newest finished one of each clutch in short: each function against a real database.

CLUTCH = "bench3-017"
AT = "2026-11-02T10:00:00+00:00"
REPORT = {"verdict": "cause_named", "causes": ["oil_change"], "advice": [{"test": "another sweep"}], "maps": {}}


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
        assert diagnoses.running(connection, CLUTCH, 1) == ["d0", "d1", "d2"]
        assert diagnoses.running(connection, CLUTCH, 2) == []
        assert diagnoses.running(connection, "another", 1) == []
        assert diagnoses.last_run_key(connection, CLUTCH) == 1
        assert diagnoses.last_run_key(connection, "another") == 0
        assert diagnoses.get(connection, "another", "d0") is None


def test_nothing_that_json_cannot_carry_is_stored(stocked: Database) -> None:
    with stocked.writing() as connection, pytest.raises(ValueError, match="not JSON compliant"):
        diagnoses.finish(connection, "d0", "later", {"rmse": float("nan")}, None)


@pytest.fixture
def stored(database: Database) -> Database:
    """Two clutches: of `a` a finished diagnosis, a later one, a failed and a running one; of `b` a failed one only."""
    with database.writing() as connection:
        for name in ("a", "b"):
            row = ClutchRow(
                clutch_id=name, record={}, content_sha256="", created_at=AT, revision=0, rank=0.0, summary={}
            )
            clutches.insert(connection, row)
        for number, name in enumerate(("a", "a", "a", "a", "b")):
            new = NewDiagnosis(
                clutch_id=name,
                diagnosis_id=f"d{number}",
                created_at=AT,
                revision=0,
                last_run_key=0,
                life="",
                as_of_cycles=None,
                code_version="0",
            )
            diagnoses.insert(connection, new)
        diagnoses.finish(connection, "d0", AT, {"verdict": "model_adequate", "causes": []}, None)
        diagnoses.finish(connection, "d1", AT, REPORT, {})
        diagnoses.fail(connection, "d2", AT, "too slow")
        diagnoses.fail(connection, "d4", AT, "too slow")
    return database


def test_the_newest_that_finished_is_told(stored: Database) -> None:
    with stored.reading() as connection:
        said = diagnoses.newest(connection, ["a", "b", "nobody"])
        assert diagnoses.newest(connection, []) == {}
        assert diagnoses.newest(connection, ["b"]) == {}
    causes, advice = ("oil_change",), ({"test": "another sweep"},)
    expected = VerdictRow(
        diagnosis_id="d1", life="", verdict="cause_named", causes=causes, advice=advice, adoptable=True, adopted=False
    )
    assert said == {"a": expected}


def test_adopted_is_what_the_model_in_force_came_from(stored: Database) -> None:
    for version, diagnosis_id in ((1, "d1"), (2, None), (3, "d0")):
        with stored.writing() as connection:
            assumptions.insert_adoption(
                connection, "a", AdoptedRow(version=version, diagnosis_id=diagnosis_id, adopted_at=AT)
            )
        with stored.reading() as connection:
            assert diagnoses.newest(connection, ["a"])["a"].adopted == (diagnosis_id == "d1")


# --- Adopted models: each function against a real database.


def test_models_are_kept_by_version(stocked: Database) -> None:
    with stocked.writing() as connection:
        assert assumptions.current_adoption(connection, CLUTCH) is None
        rows = [
            AdoptedRow(version=1, diagnosis_id="d0", adopted_at="then"),
            AdoptedRow(version=2, diagnosis_id=None, adopted_at="now"),
        ]
        for row in rows:
            assumptions.insert_adoption(connection, CLUTCH, row)
        assert assumptions.current_adoption(connection, CLUTCH) == rows[1]
        assert assumptions.adoptions_of(connection, CLUTCH) == rows[::-1]
        assert assumptions.adoptions_of(connection, "another") == []


def test_a_model_of_no_diagnosis_is_refused(stocked: Database) -> None:
    row = AdoptedRow(version=1, diagnosis_id="nothing", adopted_at="then")
    with pytest.raises(IntegrityError), stocked.writing() as connection:
        assumptions.insert_adoption(connection, CLUTCH, row)


def test_corrections_stand_beside_the_fits(stocked: Database) -> None:
    cofs = {4e5: (0.12, 0.001, (0.11, 0.13)), 5e5: (0.11, 0.002, ())}
    with stocked.writing() as connection:
        assumptions.write_corrected_cofs(connection, 1, cofs)
        assert assumptions.corrected_cofs_of(connection, CLUTCH) == {1: cofs}
        assumptions.write_corrected_cofs(connection, 1, {4e5: (0.13, 0.001, ())})
        assert assumptions.corrected_cofs_of(connection, CLUTCH) == {1: {4e5: (0.13, 0.001, ())}}
        assert assumptions.corrected_cofs_of(connection, "another") == {}
        assumptions.clear_corrected_cofs(connection, "another")
        assert assumptions.corrected_cofs_of(connection, CLUTCH)
        assumptions.clear_corrected_cofs(connection, CLUTCH)
        assert assumptions.corrected_cofs_of(connection, CLUTCH) == {}
