"""dμ/dv of a fitted curve: its gradient by differences, its sign by eye, and what it refuses."""

import numpy as np
import pytest

from models.friction.identification import fit_curves
from models.friction.slope import cof_slope, slope_gradient
from models.friction.stribeck import StribeckParameters, slope
from models.records.runs import curves_by_pressure
from models.rig.stationary import NOISELESS, stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch


@pytest.mark.parametrize("velocity", [0.3, 0.6, 3.0, 12.0])
def test_the_gradient_is_that_of_the_slope(velocity: float) -> None:
    at = np.array([22.0, 0.6, 1.4, 2.5])
    by_difference = []
    for index in range(4):
        step = np.zeros(4)
        step[index] = 1e-6 * at[index]
        up, down = (slope(np.array(velocity), StribeckParameters.from_array(at + sign * step)) for sign in (1, -1))
        by_difference.append(float(up - down) / (2e-6 * at[index]))
    gradient = slope_gradient(velocity, StribeckParameters.from_array(at))
    np.testing.assert_allclose(gradient, by_difference, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(("cycles", "falls"), [(0.0, False), (12_000.0, True)])
def test_a_noiseless_test_shows_the_true_slope_and_its_sign(cycles: float, falls: bool) -> None:
    clutch = SimulatedClutch()
    plateaus = stationary_test(clutch, cycles, np.random.default_rng(1), NOISELESS)
    pressure = float(PROTOCOL_PRESSURES[2])
    fit = fit_curves(curves_by_pressure(plateaus, clutch.geometry))[2]
    per_cof, velocity = clutch.geometry.torque_per_cof(pressure), 0.6
    found = cof_slope(fit, velocity, per_cof)
    truth = float(slope(np.array(velocity), clutch.parameters(pressure, cycles))) / per_cof
    assert found is not None
    assert found.value == pytest.approx(truth, rel=1e-3)
    assert (found.value < 0.0) is falls


def test_it_is_that_of_a_cof_at_a_speed() -> None:
    fit = fit_curves(
        curves_by_pressure(
            stationary_test(SimulatedClutch(), 0.0, np.random.default_rng(1)), SimulatedClutch().geometry
        )
    )[0]
    one, half = cof_slope(fit, 0.6, 100.0), cof_slope(fit, 0.6, 200.0)
    assert one is not None
    assert half is not None
    assert half.value == pytest.approx(one.value / 2)
    assert half.sd == pytest.approx(one.sd / 2)
    for wrong in ((0.0, 100.0), (0.6, 0.0)):
        with pytest.raises(ValueError, match="must be positive"):
            cof_slope(fit, *wrong)
