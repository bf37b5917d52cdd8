"""The newest finished diagnosis of each clutch, in short."""

import pytest

from storage import assumptions, clutches, diagnoses, verdicts
from storage.assumptions import AdoptedRow
from storage.clutches import ClutchRow
from storage.diagnoses import NewDiagnosis
from storage.engine.database import Database
from storage.verdicts import VerdictRow

AT = "2026-11-02T10:00:00+00:00"


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
        diagnoses.finish(connection, "d1", AT, {"verdict": "cause_named", "causes": ["oil_change"], "maps": {}}, {})
        diagnoses.fail(connection, "d2", AT, "too slow")
        diagnoses.fail(connection, "d4", AT, "too slow")
    return database


def test_the_newest_that_finished_is_told(stored: Database) -> None:
    with stored.reading() as connection:
        said = verdicts.newest(connection, ["a", "b", "nobody"])
        assert verdicts.newest(connection, []) == {}
        assert verdicts.newest(connection, ["b"]) == {}
    expected = VerdictRow(diagnosis_id="d1", life="", verdict="cause_named", causes=("oil_change",), adopted=False)
    assert said == {"a": expected}


def test_adopted_is_what_the_model_in_force_came_from(stored: Database) -> None:
    for version, diagnosis_id in ((1, "d1"), (2, None), (3, "d0")):
        with stored.writing() as connection:
            assumptions.insert_adoption(
                connection, "a", AdoptedRow(version=version, diagnosis_id=diagnosis_id, adopted_at=AT)
            )
        with stored.reading() as connection:
            assert verdicts.newest(connection, ["a"])["a"].adopted == (diagnosis_id == "d1")
