"""Structure without a name, filled in smoothly: it fits what was planted, and nothing where nothing was."""

import numpy as np
import pytest

from models.diagnosis.design.design import CYCLES, PHASE, PRESSURE, SPEED
from models.diagnosis.validation.extended_model import SLUG, smooth_fit
from models.diagnosis.validation.held_out import measure_gain
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, bump, study


@pytest.fixture(scope="module")
def bumped() -> Study:
    return study(campaign(41, bump, loops=False))


def smoothed(given: Study, *axes: str):
    return smooth_fit(given.problem, given.baseline.fit, axes)


def test_a_bump_in_speed_is_filled_in(bumped):
    found = smoothed(bumped, SPEED)
    assert {each.effect.slug for each in found.effects} == {SLUG}
    assert bumped.baseline.fit.cost - found.cost > 20
    # what the fit adds to the baseline peaks where the bump is, relative to the curve
    velocity = bumped.design.rows.velocity
    near, far = np.abs(velocity - 3) < 0.6, velocity > 8
    off = (bumped.design.torque - found.torque)[near].mean()
    assert abs(off) < 0.4 * abs(bumped.baseline.fit.residual[near].mean())
    assert abs((bumped.design.torque - found.torque)[far].mean()) < 0.1
    gain = measure_gain(bumped.problem, bumped.baseline.fit, found, np.random.default_rng(0))
    assert gain.log_score_gain > 10
    assert gain.rmse_after < gain.rmse_before


def test_the_wrong_axis_and_no_structure_gain_nothing(bumped):
    wrong = smoothed(bumped, CYCLES)
    assert bumped.baseline.fit.cost - wrong.cost < 5
    plain = study(campaign(41, loops=False))
    found = smoothed(plain, SPEED)
    assert plain.baseline.fit.cost - found.cost < 5
    gain = measure_gain(plain.problem, plain.baseline.fit, found, np.random.default_rng(0))
    assert abs(gain.log_score_gain) < 5


def test_axes_that_cannot_carry_it(bumped):
    assert smoothed(bumped) is None
    assert smoothed(bumped, "noise") is None
    assert smoothed(bumped, PHASE) is None  # no loops
    assert smoothed(bumped, PRESSURE) is not None
    one = study(campaign(42, loops=False, cycles=(500.0,)))
    assert smoothed(one, CYCLES) is None
