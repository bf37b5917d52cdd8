"""What was computed of runs and lives: fits, predictions and filters' states."""

from dataclasses import replace
from math import nan

import numpy as np
import pytest
from sqlalchemy import Connection, update
from sqlalchemy.exc import IntegrityError

from storage import results, runs
from storage.engine.errors import DamagedData
from storage.results import FilterStateRow, PredictionRow
from storage.tables import filter_state
from tests.storage.samples import CLUTCH, fit_row, new_run


def prediction(cycles: float, method: str = "grid", pressure: float = 0.0, said: str = "first") -> PredictionRow:
    return PredictionRow(
        cycles=cycles, method=method, pressure=pressure, payload={"said": said, "at": cycles}, code_version="0.1.0"
    )


def test_predictions_as_they_would_have_been_said_then(connection: Connection) -> None:
    said = [prediction(cycles) for cycles in (7000.0, 0.0, 3000.0)]
    others = [prediction(9000.0, "ukf"), prediction(9000.0, pressure=5e5)]
    results.put_predictions(connection, CLUTCH, said + others)
    results.put_predictions(connection, "other", [prediction(8000.0)])
    results.put_predictions(connection, CLUTCH, [])
    expected = {None: 7000.0, 1e9: 7000.0, 7000.0: 7000.0, 6999.9: 3000.0, 0.0: 0.0}
    for at_cycles, cycles in expected.items():
        assert results.prediction_at(connection, CLUTCH, "grid", 0.0, at_cycles) == prediction(cycles)
    assert results.prediction_at(connection, CLUTCH, "grid", 0.0, -1.0) is None
    assert results.prediction_at(connection, CLUTCH, "particle", 0.0) is None
    history = results.predictions_of(connection, CLUTCH, "grid", 0.0)
    assert [row.cycles for row in history] == [0.0, 3000.0, 7000.0]
    # replaced, and cleared for one clutch
    results.put_predictions(connection, CLUTCH, [prediction(7000.0, said="again")])
    assert results.prediction_at(connection, CLUTCH, "grid", 0.0) == prediction(7000.0, said="again")
    assert len(results.predictions_of(connection, CLUTCH, "grid", 0.0)) == 3
    results.clear_predictions(connection, CLUTCH)
    assert results.predictions_of(connection, CLUTCH, "grid", 0.0) == []
    assert results.prediction_at(connection, "other", "grid", 0.0) == prediction(8000.0)
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        results.put_predictions(connection, "nobody", [prediction(0.0)])


def test_fits_come_back_are_replaced_and_have_sixteen_finite_covariances_and_a_run(connection: Connection) -> None:
    late, early, bare = (runs.insert(connection, new_run(number)) for number in (2, 1, 3))
    without = fit_row(1e5, mse_percent=None)
    results.write_fits(connection, late, [fit_row(5e5), without])
    results.write_fits(connection, early, [fit_row(9e5), fit_row(3e5)])
    results.write_fits(connection, early, (fit_row(4e5),))
    results.write_fits(connection, bare, [])
    of_clutch = results.fits_of(connection, CLUTCH)
    assert list(of_clutch) == [early, late]
    assert of_clutch == {early: [fit_row(4e5)], late: [without, fit_row(5e5)]}
    assert results.fits_of(connection, "unknown") == {}
    for wrong, says in (
        (fit_row(1e5, covariance=(1.0, 2.0, 3.0)), "16 numbers, got 3"),
        (fit_row(1e5, covariance=(nan,) * 16), "not JSON compliant"),
        (fit_row(1e5, unbiased_covariance=(1.0,)), "unbiased_covariance must hold 16 numbers, got 1"),
    ):
        with pytest.raises(ValueError, match=says):
            results.write_fits(connection, bare, [wrong])
    with pytest.raises(IntegrityError), connection.begin_nested():
        results.write_fits(connection, bare, [fit_row(1e5, rmse=nan)])
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        results.write_fits(connection, 99, [fit_row(1e5)])


def state(method: str, pressure: float, runs: int = 8) -> FilterStateRow:
    rng = np.random.default_rng(runs)
    arrays = {"weight": rng.random(5), "mean": rng.random((5, 2)), "scatter": np.array(-0.0)}
    return FilterStateRow(method=method, pressure=pressure, runs=runs, arrays=arrays, code_version="0.1.0")


def assert_same(stored: FilterStateRow, expected: FilterStateRow) -> None:
    assert repr(replace(stored, arrays={})) == repr(replace(expected, arrays={}))
    assert list(stored.arrays) == list(expected.arrays)
    for name, array in expected.arrays.items():
        assert stored.arrays[name].shape == array.shape
        assert stored.arrays[name].tobytes() == array.tobytes()


def test_filter_states_come_back_are_replaced_and_cleared(connection: Connection) -> None:
    results.put_filter_states(connection, CLUTCH, [state("ukf", 0.0), state("grid", 5e5), state("grid", 0.0)])
    results.put_filter_states(connection, CLUTCH, [state("grid", 0.0, runs=9)])
    results.put_filter_states(connection, CLUTCH, [])
    results.put_filter_states(connection, "other", [state("ukf", 0.0)])
    states = results.filter_states_of(connection, CLUTCH)
    assert list(states) == [("grid", 0.0), ("grid", 5e5), ("ukf", 0.0)]
    assert_same(states["grid", 0.0], state("grid", 0.0, runs=9))
    assert_same(states["grid", 5e5], state("grid", 5e5))
    results.clear_filter_states(connection, CLUTCH)
    assert results.filter_states_of(connection, CLUTCH) == {}
    assert list(results.filter_states_of(connection, "other")) == [("ukf", 0.0)]
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), connection.begin_nested():
        results.put_filter_states(connection, "nobody", [state("ukf", 0.0)])


def test_a_damaged_state_is_named(connection: Connection) -> None:
    results.put_filter_states(connection, CLUTCH, [state("ukf", 5e5)])
    connection.execute(update(filter_state).values(arrays=b"\0"))
    with pytest.raises(DamagedData, match=r"state of ukf at 500000 Pa of clutch 'bench3"):
        results.filter_states_of(connection, CLUTCH)
