"""Adopted models: each function against a real database."""

import pytest
from sqlalchemy.exc import IntegrityError

from storage import assumptions
from storage.assumptions import AdoptedRow
from storage.engine.database import Database
from tests.storage.samples import store_diagnoses

CLUTCH = "bench3-017"


@pytest.fixture
def stocked(database: Database) -> Database:
    return store_diagnoses(database)


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
