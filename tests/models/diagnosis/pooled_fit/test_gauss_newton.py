"""A fit says how it ended: converged, without a step that lowers the cost, out of steps, without a finite cost."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.baseline.laws import Laws
from models.diagnosis.baseline.prediction import frame_of
from models.diagnosis.pooled_fit.baseline_fit import starting_laws
from models.diagnosis.pooled_fit.gauss_newton import FitStatus, fit
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study


@pytest.fixture(scope="module")
def given() -> Study:
    return study(campaign(2, loops=False))


def start_of(given: Study) -> Laws:
    return starting_laws(given.design, frame_of(given.design))


def test_enough_steps_converge_and_too_few_do_not(given: Study) -> None:
    ended = fit(given.problem, start_of(given), steps=60)
    assert ended.status in {FitStatus.CONVERGED, FitStatus.STALLED}
    assert 1 < ended.steps < 60
    cut = fit(given.problem, start_of(given), steps=1)
    assert (cut.status, cut.steps) == (FitStatus.OUT_OF_STEPS, 1)
    assert cut.cost > ended.cost + 1.0
    assert fit(given.problem, start_of(given), steps=0).status is FitStatus.OUT_OF_STEPS


def test_a_fit_from_its_own_end_makes_no_way(given: Study) -> None:
    ended = fit(given.problem, start_of(given), steps=60)
    again = fit(given.problem, ended.laws)
    assert again.status in {FitStatus.CONVERGED, FitStatus.STALLED}
    assert ended.cost - 1.0 < again.cost <= ended.cost


def test_numbers_that_cannot_be_fitted_are_a_status(given: Study) -> None:
    torque = given.design.torque.copy()
    torque[3] = np.nan
    broken = fit(replace(given.problem, design=replace(given.design, torque=torque)), start_of(given))
    assert broken.status is FitStatus.NOT_FINITE
    assert np.isinf(broken.cost)
