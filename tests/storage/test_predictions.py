"""Predictions: each function against a real database."""

import pytest
from sqlalchemy.exc import IntegrityError

from storage import results
from storage.engine.database import Database
from storage.results import PredictionRow
from tests.storage.samples import store_two_clutches

CLUTCH = "bench3-017"


@pytest.fixture
def stocked(database: Database) -> Database:
    return store_two_clutches(database)


def prediction(cycles: float, method: str = "grid", pressure: float = 0.0, said: str = "first") -> PredictionRow:
    return PredictionRow(
        cycles=cycles, method=method, pressure=pressure, payload={"said": said, "at": cycles}, code_version="0.1.0"
    )


def test_predictions_as_they_would_have_been_said_then(stocked: Database) -> None:
    said = [prediction(cycles) for cycles in (7000.0, 0.0, 3000.0)]
    others = [prediction(9000.0, "ukf"), prediction(9000.0, pressure=5e5)]
    with stocked.writing() as connection:
        results.put_predictions(connection, CLUTCH, said + others)
        results.put_predictions(connection, "other", [prediction(8000.0)])
        results.put_predictions(connection, CLUTCH, [])
    expected = {None: 7000.0, 1e9: 7000.0, 7000.0: 7000.0, 6999.9: 3000.0, 0.0: 0.0}
    with stocked.reading() as connection:
        for at_cycles, cycles in expected.items():
            assert results.prediction_at(connection, CLUTCH, "grid", 0.0, at_cycles) == prediction(cycles)
        assert results.prediction_at(connection, CLUTCH, "grid", 0.0, -1.0) is None
        assert results.prediction_at(connection, CLUTCH, "particle", 0.0) is None
        history = results.predictions_of(connection, CLUTCH, "grid", 0.0)
        assert [row.cycles for row in history] == [0.0, 3000.0, 7000.0]


def test_predictions_are_replaced_and_cleared_for_one_clutch(stocked: Database) -> None:
    with stocked.writing() as connection:
        for clutch_id in (CLUTCH, "other"):
            results.put_predictions(connection, clutch_id, [prediction(0.0), prediction(1.0)])
        results.put_predictions(connection, CLUTCH, [prediction(1.0, said="again")])
        assert results.prediction_at(connection, CLUTCH, "grid", 0.0) == prediction(1.0, said="again")
        assert len(results.predictions_of(connection, CLUTCH, "grid", 0.0)) == 2
        results.clear_predictions(connection, CLUTCH)
        assert results.predictions_of(connection, CLUTCH, "grid", 0.0) == []
        assert results.prediction_at(connection, "other", "grid", 0.0) == prediction(1.0)


def test_predictions_belong_to_a_clutch(database: Database) -> None:
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), database.writing() as connection:
        results.put_predictions(connection, "nobody", [prediction(0.0)])
