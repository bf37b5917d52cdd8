"""Adopted models: each function against a real file."""

import pytest
from sqlalchemy.exc import IntegrityError

from storage import adopted_models
from storage.adopted_models import AdoptedRow
from storage.engine.database import Database
from tests.storage.samples import store_diagnoses

CLUTCH = "bench3-017"


@pytest.fixture
def stocked(database: Database) -> Database:
    return store_diagnoses(database)


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
