"""Diagnoses, and the newest finished one of each clutch in short."""

import pytest
from sqlalchemy import Connection

from storage import assumptions, diagnoses
from storage.assumptions import AdoptedRow
from storage.diagnoses import FAILED, FINISHED, RUNNING, VerdictRow
from tests.storage.samples import CLUTCH, new_diagnosis, store_run

AT = "2026-11-02T10:00:00+00:00"
REPORT = {"verdict": "cause_named", "causes": ["oil_change"], "advice": [{"test": "another sweep"}], "maps": {}}


@pytest.fixture
def connection(connection: Connection) -> Connection:
    """Four running diagnoses of a clutch, and one of the other."""
    for number in range(4):
        diagnoses.insert(connection, new_diagnosis(number))
    diagnoses.insert(connection, new_diagnosis(4, "other"))
    return connection


def test_a_diagnosis_runs_and_ends_once(connection: Connection) -> None:
    row = diagnoses.get(connection, CLUTCH, "d0")
    assert (row.status, row.report, row.as_of_cycles, row.last_run_key) == (RUNNING, None, 1000.0, 1)
    assert diagnoses.finish(connection, "d0", "later", {"verdict": "model_adequate"}, {"effects": []})
    assert not diagnoses.fail(connection, "d0", "later still", "too late")
    assert diagnoses.fail(connection, "d1", "later", "it broke")
    with pytest.raises(ValueError, match="not JSON compliant"):
        diagnoses.finish(connection, "d2", "later", {"rmse": float("nan")}, None)
    found = {row.diagnosis_id: row for row in diagnoses.page(connection, CLUTCH, limit=10)}
    assert list(found) == ["d3", "d2", "d1", "d0"]
    assert (found["d0"].status, found["d0"].report) == (FINISHED, {"verdict": "model_adequate"})
    assert found["d0"].extension == {"effects": []}
    assert (found["d1"].status, found["d1"].problem, found["d1"].report) == (FAILED, "it broke", None)
    assert (found["d2"].status, found["d2"].finished_at) == (RUNNING, None)


def test_pages_and_the_one_that_runs(connection: Connection) -> None:
    first = diagnoses.page(connection, CLUTCH, limit=2)
    rest = diagnoses.page(connection, CLUTCH, limit=2, before=first[-1].diagnosis_key)
    assert [row.diagnosis_id for row in (*first, *rest)] == ["d3", "d2", "d1", "d0"]
    assert diagnoses.running(connection, CLUTCH, 1) == ["d0", "d1", "d2", "d3"]
    assert diagnoses.running(connection, CLUTCH, 2) == diagnoses.running(connection, "nobody", 1) == []
    asked_since = [diagnoses.running(connection, CLUTCH, 1, since=revision) for revision in (3, 4)]
    assert asked_since == [["d0", "d1", "d2", "d3"], []]
    assert diagnoses.get(connection, "other", "d0") is None
    key = store_run(connection, 1)
    assert (diagnoses.last_run_key(connection, CLUTCH), diagnoses.last_run_key(connection, "other")) == (key, 0)


def test_the_newest_that_finished_is_told_and_whether_the_model_in_force_came_from_it(connection: Connection) -> None:
    diagnoses.finish(connection, "d0", AT, {"verdict": "model_adequate", "causes": []}, None)
    diagnoses.finish(connection, "d1", AT, REPORT, {})
    for failed in ("d2", "d4"):
        diagnoses.fail(connection, failed, AT, "too slow")
    causes, advice = ("oil_change",), ({"test": "another sweep"},)
    expected = VerdictRow(
        diagnosis_id="d1", life="", verdict="cause_named", causes=causes, advice=advice, adoptable=True, adopted=False
    )
    assert diagnoses.newest(connection, [CLUTCH, "other", "nobody"]) == {CLUTCH: expected}
    assert diagnoses.newest(connection, []) == diagnoses.newest(connection, ["other"]) == {}
    for version, diagnosis_id in ((1, "d1"), (2, None), (3, "d0")):
        adopted = AdoptedRow(version=version, diagnosis_id=diagnosis_id, adopted_at=AT)
        assumptions.insert_adoption(connection, CLUTCH, adopted)
        assert diagnoses.newest(connection, [CLUTCH])[CLUTCH].adopted == (diagnosis_id == "d1")
