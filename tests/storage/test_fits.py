"""Fits: each function against a real database."""

from dataclasses import replace
from math import nan

import pytest
from sqlalchemy.exc import IntegrityError

from storage import clutches, results, runs
from storage.engine.database import Database
from tests.storage.samples import clutch_row, fit_row, new_run

CLUTCH = "bench3-017"


def test_fits_come_back_and_are_replaced(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        late, early, bare = (runs.insert(connection, new_run(number)) for number in (2, 1, 3))
        results.write_fits(connection, late, [fit_row(5e5), fit_row(1e5, mse_percent=None)])
        results.write_fits(connection, early, [fit_row(9e5), fit_row(3e5)])
        results.write_fits(connection, early, (fit_row(4e5),))
        results.write_fits(connection, bare, [])
    with database.reading() as connection:
        assert results.fits_of(connection, CLUTCH).get(late, []) == [fit_row(1e5, mse_percent=None), fit_row(5e5)]
        of_clutch = results.fits_of(connection, CLUTCH)
        assert list(of_clutch) == [early, late]
        assert of_clutch == {early: [fit_row(4e5)], late: [fit_row(1e5, mse_percent=None), fit_row(5e5)]}
        assert results.fits_of(connection, CLUTCH).get(bare, []) == []
        assert results.fits_of(connection, "unknown") == {}


def test_a_fit_has_sixteen_finite_covariances_and_a_run(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        key = runs.insert(connection, new_run())
        with pytest.raises(ValueError, match="16 numbers, got 3"):
            results.write_fits(connection, key, [replace(fit_row(1e5), covariance=(1.0, 2.0, 3.0))])
        with pytest.raises(ValueError, match="not JSON compliant"):
            results.write_fits(connection, key, [replace(fit_row(1e5), covariance=(nan,) * 16)])
    with pytest.raises(IntegrityError), database.writing() as connection:
        results.write_fits(connection, key, [replace(fit_row(1e5), rmse=nan)])
    with pytest.raises(IntegrityError, match=r"(?i)foreign key"), database.writing() as connection:
        results.write_fits(connection, 99, [fit_row(1e5)])
