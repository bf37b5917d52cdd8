"""Fits as rows and back."""

from collections.abc import Sequence

import numpy as np

from models.rig.stationary import stationary_test
from models.rig.truth import draw
from service import records
from service.lives.run_analysis import LevelFit, levels_of
from storage import clutches, results, runs
from storage.engine.database import Database
from storage.results import FitRow
from tests.storage.samples import clutch_row, new_run


def fitted() -> tuple[LevelFit, ...]:
    """The curves of one test of a simulated clutch."""
    rng = np.random.default_rng(3)
    clutch = draw(rng)
    return levels_of(stationary_test(clutch, 0.0, rng), clutch.geometry)


def stored(database: Database, rows: Sequence[FitRow]) -> tuple[LevelFit, ...]:
    """What is read of a run's fits."""
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        results.write_fits(connection, runs.insert(connection, new_run()), rows)
        [found] = records.levels(connection, clutch_row().clutch_id).values()
    return found


def test_fits_come_back_with_both_covariances(database: Database) -> None:
    levels = fitted()
    found = stored(database, records.fit_rows(levels, {}))
    for sent, back in zip(levels, found, strict=True):
        np.testing.assert_array_equal(back.fit.covariance, sent.fit.covariance)
        np.testing.assert_array_equal(back.fit.unbiased_covariance, sent.fit.unbiased_covariance)
    determined = [each.fit for each in found if not each.fit.undetermined]
    assert len(determined) >= 3
    assert all((fit.unbiased_covariance.diagonal() < fit.covariance.diagonal()).all() for fit in determined)
