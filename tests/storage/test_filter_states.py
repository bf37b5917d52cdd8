"""Filter states: each function against a real database."""

from dataclasses import replace

import numpy as np
import pytest
from sqlalchemy import update
from sqlalchemy.exc import IntegrityError

from storage import results
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.results import FilterStateRow
from storage.tables import filter_state
from tests.storage.samples import store_two_clutches

CLUTCH = "bench3-017"


@pytest.fixture
def stocked(database: Database) -> Database:
    return store_two_clutches(database)


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
        results.put_filter_states(connection, CLUTCH, [state("ukf", 0.0), state("grid", 5e5), state("grid", 0.0)])
        results.put_filter_states(connection, CLUTCH, [state("grid", 0.0, runs=9)])
        results.put_filter_states(connection, CLUTCH, [])
        results.put_filter_states(connection, "other", [state("ukf", 0.0)])
    with stocked.reading() as connection:
        states = results.filter_states_of(connection, CLUTCH)
        assert list(states) == [("grid", 0.0), ("grid", 5e5), ("ukf", 0.0)]
        assert_same(states["grid", 0.0], state("grid", 0.0, runs=9))
        assert_same(states["grid", 5e5], state("grid", 5e5))
    with stocked.writing() as connection:
        results.clear_filter_states(connection, CLUTCH)
        assert results.filter_states_of(connection, CLUTCH) == {}
        assert list(results.filter_states_of(connection, "other")) == [("ukf", 0.0)]


def test_a_damaged_state_is_named(stocked: Database) -> None:
    with stocked.writing() as connection:
        results.put_filter_states(connection, CLUTCH, [state("ukf", 5e5)])
        connection.execute(update(filter_state).values(arrays=b"\0"))
    with (
        stocked.reading() as connection,
        pytest.raises(DamagedData, match=r"state of ukf at 500000 Pa of clutch 'bench3"),
    ):
        results.filter_states_of(connection, CLUTCH)


def test_states_belong_to_a_clutch(database: Database) -> None:
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), database.writing() as connection:
        results.put_filter_states(connection, "nobody", [state("ukf", 0.0)])
