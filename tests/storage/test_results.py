"""Predictions, filter states and access keys: each function against a real file."""

from dataclasses import replace

import numpy as np
import pytest
from sqlalchemy.exc import IntegrityError

from storage import clutches, filter_states, keys, predictions
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.filter_states import FilterStateRow
from storage.keys import KeyRow
from storage.predictions import PredictionRow
from tests.storage.samples import clutch_row

CLUTCH = "bench3-017"


@pytest.fixture
def stocked(database: Database) -> Database:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        clutches.insert(connection, clutch_row("other"))
    return database


def prediction(cycles: float, method: str = "grid", pressure: float = 0.0, said: str = "first") -> PredictionRow:
    return PredictionRow(
        cycles=cycles, method=method, pressure=pressure, payload={"said": said, "at": cycles}, code_version="0.1.0"
    )


def test_predictions_as_they_would_have_been_said_then(stocked: Database) -> None:
    said = [prediction(cycles) for cycles in (7000.0, 0.0, 3000.0)]
    others = [prediction(9000.0, "ukf"), prediction(9000.0, pressure=5e5)]
    with stocked.writing() as connection:
        predictions.put(connection, CLUTCH, said + others)
        predictions.put(connection, "other", [prediction(8000.0)])
        predictions.put(connection, CLUTCH, [])
    expected = {None: 7000.0, 1e9: 7000.0, 7000.0: 7000.0, 6999.9: 3000.0, 0.0: 0.0}
    with stocked.reading() as connection:
        for at_cycles, cycles in expected.items():
            assert predictions.at(connection, CLUTCH, "grid", 0.0, at_cycles) == prediction(cycles)
        assert predictions.at(connection, CLUTCH, "grid", 0.0, -1.0) is None
        assert predictions.at(connection, CLUTCH, "particle", 0.0) is None
        history = predictions.history(connection, CLUTCH, "grid", 0.0)
        assert [row.cycles for row in history] == [0.0, 3000.0, 7000.0]


def test_predictions_are_replaced_and_cleared_for_one_clutch(stocked: Database) -> None:
    with stocked.writing() as connection:
        for clutch_id in (CLUTCH, "other"):
            predictions.put(connection, clutch_id, [prediction(0.0), prediction(1.0)])
        predictions.put(connection, CLUTCH, [prediction(1.0, said="again")])
        assert predictions.at(connection, CLUTCH, "grid", 0.0) == prediction(1.0, said="again")
        assert len(predictions.history(connection, CLUTCH, "grid", 0.0)) == 2
        predictions.clear(connection, CLUTCH)
        assert predictions.history(connection, CLUTCH, "grid", 0.0) == []
        assert predictions.at(connection, "other", "grid", 0.0) == prediction(1.0)


def state(method: str, pressure: float, runs: int = 8) -> FilterStateRow:
    rng = np.random.default_rng(runs)
    arrays = {"weight": rng.random(5), "mean": rng.random((5, 2)), "scatter": np.array(-0.0)}
    return FilterStateRow(method=method, pressure=pressure, runs=runs, arrays=arrays, code_version="0.1.0")


def assert_same(stored: FilterStateRow, expected: FilterStateRow) -> None:
    assert replace(stored, arrays={}).__repr__() == replace(expected, arrays={}).__repr__()
    assert list(stored.arrays) == list(expected.arrays)
    for name, array in expected.arrays.items():
        assert stored.arrays[name].shape == array.shape
        assert stored.arrays[name].tobytes() == array.tobytes()


def test_filter_states_come_back_are_replaced_and_cleared(stocked: Database) -> None:
    with stocked.writing() as connection:
        filter_states.put(connection, CLUTCH, [state("ukf", 0.0), state("grid", 5e5), state("grid", 0.0)])
        filter_states.put(connection, CLUTCH, [state("grid", 0.0, runs=9)])
        filter_states.put(connection, CLUTCH, [])
        filter_states.put(connection, "other", [state("ukf", 0.0)])
    with stocked.reading() as connection:
        states = filter_states.get(connection, CLUTCH)
        assert list(states) == [("grid", 0.0), ("grid", 5e5), ("ukf", 0.0)]
        assert_same(states["grid", 0.0], state("grid", 0.0, runs=9))
        assert_same(states["grid", 5e5], state("grid", 5e5))
    with stocked.writing() as connection:
        filter_states.clear(connection, CLUTCH)
        assert filter_states.get(connection, CLUTCH) == {}
        assert list(filter_states.get(connection, "other")) == [("ukf", 0.0)]


def test_a_damaged_state_is_named(stocked: Database) -> None:
    with stocked.writing() as connection:
        filter_states.put(connection, CLUTCH, [state("ukf", 5e5)])
        connection.exec_driver_sql("UPDATE filter_state SET arrays = x'00'")
    with (
        stocked.reading() as connection,
        pytest.raises(DamagedData, match=r"state of ukf at 500000 Pa of clutch 'bench3"),
    ):
        filter_states.get(connection, CLUTCH)


def test_results_belong_to_a_clutch(database: Database) -> None:
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), database.writing() as connection:
        predictions.put(connection, "nobody", [prediction(0.0)])
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), database.writing() as connection:
        filter_states.put(connection, "nobody", [state("ukf", 0.0)])


def key(key_id: str, secret: str, created_at: str = "2026-01-01T00:00:00Z") -> KeyRow:
    return KeyRow(key_id=key_id, scope="ingest", secret_sha256=secret, note="bench 3", created_at=created_at)


def test_a_key_opens_until_it_is_revoked(database: Database) -> None:
    with database.writing() as connection:
        assert not keys.any_active(connection)
        keys.insert(connection, key("k2", "bb"))
        keys.insert(connection, key("k1", "aa", "2026-02-01T00:00:00Z"))
        assert keys.any_active(connection)
        assert keys.by_secret_hash(connection, "aa") == key("k1", "aa", "2026-02-01T00:00:00Z")
        assert keys.by_secret_hash(connection, "cc") is None
        assert keys.revoke(connection, "k2", "2026-03-01T00:00:00Z")
        assert not keys.revoke(connection, "k2", "2026-04-01T00:00:00Z")
        assert not keys.revoke(connection, "unknown", "2026-04-01T00:00:00Z")
        assert keys.by_secret_hash(connection, "bb") is None
        assert keys.any_active(connection)
        keys.revoke(connection, "k1", "2026-03-02T00:00:00Z")
        assert not keys.any_active(connection)
        listed = keys.all_keys(connection)
        assert [(row.key_id, row.revoked_at) for row in listed] == [
            ("k2", "2026-03-01T00:00:00Z"),
            ("k1", "2026-03-02T00:00:00Z"),
        ]


@pytest.mark.parametrize("second", [key("k1", "bb"), key("k2", "aa")])
def test_a_key_id_and_a_secret_are_taken_once(database: Database, second: KeyRow) -> None:
    with database.writing() as connection:
        keys.insert(connection, key("k1", "aa"))
    with pytest.raises(IntegrityError, match="UNIQUE"), database.writing() as connection:
        keys.insert(connection, second)
