"""Eq. 3 and its derivatives against the formula as printed, finite differences and a complex step."""

import numpy as np
import pytest

from models.friction.identification import cof_slope, fit_curves
from models.friction.stribeck import GAMMA, PARAMETER_NAMES, StribeckParameters, gradient, slope, slope_gradient, torque
from models.records.runs import curves_by_pressure
from models.rig.stationary import stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch
from tests.models.friction.stribeck_curves import VELOCITY, eq3, parameters
from tests.models.rig.exact import NOISELESS

FRESH = np.array([25.0, 0.57, 4.5, 2.5])
CASES = [FRESH, np.array([12.0, 0.4, 2.7, 3.2]), np.array([3.0, 4.0, 0.3, 0.0]), np.array([0.0, 1.0, 1.0, 2.0])]


@pytest.mark.parametrize("values", CASES)
def test_torque_is_eq_3_as_printed_and_odd_with_its_derivatives(values) -> None:
    p = parameters(values)
    np.testing.assert_allclose(torque(VELOCITY, p), eq3(values, VELOCITY), rtol=1e-14)
    np.testing.assert_array_equal(torque(-VELOCITY, p), -torque(VELOCITY, p))
    np.testing.assert_array_equal(gradient(-VELOCITY, p), -gradient(VELOCITY, p))
    # A complex step has no cancellation: equal to rounding.
    steps = np.eye(4) * 1e-30j
    witness = np.stack([_complex_eq3(values + step).imag / 1e-30 for step in steps], axis=1)
    np.testing.assert_allclose(gradient(VELOCITY, p), witness, rtol=1e-12, atol=1e-14)
    # Differences over 1e-5 of v: truncation 1e-10 and rounding 1e-11 of the torque over the step.
    h = 1e-5 * VELOCITY
    witness = (torque(VELOCITY + h, p) - torque(VELOCITY - h, p)) / (2 * h)
    np.testing.assert_allclose(slope(VELOCITY, p), witness, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(slope(-VELOCITY, p), slope(VELOCITY, p))


def _complex_eq3(x):
    return x[0] * (1 + (x[1] - 1) * np.exp(-x[2] / VELOCITY)) + x[3] * VELOCITY**GAMMA


def test_at_rest_the_sign_bit_names_the_limit() -> None:
    p = parameters(FRESH)
    assert torque(np.array([0.0, -0.0]), p).tolist() == [25.0, -25.0]
    assert gradient(np.array([0.0, -0.0]), p).tolist() == [[1, 0, 0, 0], [-1, 0, 0, 0]]
    tiny = np.array([1e-30, -1e-30])  # |v|^0.3 = 1e-9 is what is left of the viscous term
    np.testing.assert_allclose(torque(tiny, p), [25.0, -25.0], atol=1e-8)
    assert slope(np.array([0.0]), p).tolist() == [np.inf]
    assert slope(np.array([0.0]), parameters([25.0, 0.5, 4.5, 0.0])).tolist() == [0.0]
    # V_S = 0 means e = 1 wherever it moves; at rest e is 0 by its limit, for every V_S.
    p = parameters([20.0, 0.5, 0.0, 0.0])
    assert torque(np.array([0.0, 1e-9, 5.0]), p).tolist() == [20.0, 10.0, 10.0]


def test_parameters_round_trip_and_broadcast() -> None:
    p = parameters(FRESH)
    np.testing.assert_array_equal(p.as_array(), FRESH)
    assert isinstance(p.static_torque, float)
    many = StribeckParameters.from_array(np.stack([FRESH, 2 * FRESH], axis=1)[..., None])
    assert torque(VELOCITY, many).shape == (2, VELOCITY.size)
    assert gradient(VELOCITY, many).shape == (2, VELOCITY.size, 4)
    np.testing.assert_array_equal(torque(VELOCITY, many)[0], torque(VELOCITY, p))
    assert many.as_array().shape == (4, 2, 1)
    # an array of another length is refused
    with pytest.raises(ValueError, match="values must have 4 rows"):
        StribeckParameters.from_array(np.ones(3))


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
@pytest.mark.parametrize("index", range(4))
def test_a_parameter_that_is_not_finite_and_positive_is_refused(bad, index):
    values = FRESH.copy()
    values[index] = bad
    with pytest.raises(ValueError, match=f"{PARAMETER_NAMES[index]} must be finite and not negative"):
        parameters(values)


# --- dμ/dv of a fitted curve: its gradient by differences, its sign by eye, and what it refuses.


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
    found, _ = cof_slope(fit, velocity, per_cof)
    truth = float(slope(np.array(velocity), clutch.parameters(pressure, cycles))) / per_cof
    assert found == pytest.approx(truth, rel=1e-3)
    assert (found < 0.0) is falls


def test_it_is_that_of_a_cof_at_a_speed() -> None:
    plateaus = stationary_test(SimulatedClutch(), 0.0, np.random.default_rng(1))
    fit = fit_curves(curves_by_pressure(plateaus, SimulatedClutch().geometry))[0]
    one, half = cof_slope(fit, 0.6, 100.0), cof_slope(fit, 0.6, 200.0)
    assert half == pytest.approx((one[0] / 2, one[1] / 2))
    for wrong in ((0.0, 100.0), (0.6, 0.0)):
        with pytest.raises(ValueError, match="must be positive"):
            cof_slope(fit, *wrong)
