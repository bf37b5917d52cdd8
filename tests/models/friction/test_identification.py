"""The identification on curves whose answer is known: exact recovery, symmetries, bounds, and input that is hard."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from models.friction.identification import StribeckFitStatus, fit_curves, mean_torques
from models.friction.stribeck import PARAMETER_NAMES, torque
from models.friction.variable_projection import jacobian, make_problem, minimise, profile
from tests.models.friction.stribeck_curves import PRESSURES, VELOCITY, clutch, curve, eq3, hard_curve

FRESH = np.array([25.0, 0.57, 4.5, 2.5])


def one(velocity, measured, sd=None):
    return fit_curves([curve(velocity, measured, sd)])[0]


def noisy(seed, share=0.01):
    return eq3(FRESH, VELOCITY) * (1 + share * np.random.default_rng(seed).standard_normal(VELOCITY.size))


@pytest.mark.parametrize("life", [0.0, 0.5, 1.0])
def test_noiseless_curves_are_recovered(life):
    """To 1e-5: the search ends where log V_S stands to about 1e-6, and M_s, M̄_c, C_v follow it a few times over."""
    truth = clutch(PRESSURES, np.full(PRESSURES.size, life))
    fits = fit_curves([curve(VELOCITY, row, bar=p) for row, p in zip(eq3(truth, VELOCITY), PRESSURES, strict=True)])
    np.testing.assert_allclose([fit.parameters.as_array() for fit in fits], truth, rtol=1e-5)
    assert [fit.pressure for fit in fits] == (PRESSURES * 1e5).tolist()
    assert all(fit.status is StribeckFitStatus.DETERMINED and fit.acceptable for fit in fits)


def test_fits_do_not_depend_on_the_curves_beside_them_nor_on_batches() -> None:
    curves = [curve(VELOCITY, noisy(1)), curve(VELOCITY[::4], noisy(2)[::4]), curve(VELOCITY[:1], [3.0])]
    for together, alone in zip(fit_curves(curves), (fit_curves([each])[0] for each in curves), strict=True):
        np.testing.assert_allclose(together.parameters.as_array(), alone.parameters.as_array(), rtol=1e-6)
    assert fit_curves([]) == ()
    # many points are fitted in batches
    velocity, measured = np.tile(VELOCITY, 300), np.tile(eq3(FRESH, VELOCITY), 300)
    fits = fit_curves([curve(velocity, measured), curve(velocity, measured)])
    np.testing.assert_allclose([fit.parameters.as_array() for fit in fits], [FRESH, FRESH], rtol=1e-5)


@settings(max_examples=30, deadline=None)
@given(scale=st.floats(1e-3, 1e3), seed=st.integers(0, 50))
def test_scaling_torque_scales_m_s_and_c_v_alone(scale, seed):
    before, after = one(VELOCITY, noisy(seed)), one(VELOCITY, scale * noisy(seed))
    factor = np.array([scale, 1.0, 1.0, scale])
    np.testing.assert_allclose(after.parameters.as_array(), before.parameters.as_array() * factor, rtol=1e-4)
    np.testing.assert_allclose(after.standard_errors, before.standard_errors * factor, rtol=1e-4)
    assert after.mse_percent == pytest.approx(before.mse_percent, rel=1e-6)


@settings(max_examples=30, deadline=None)
@given(order=st.permutations(range(VELOCITY.size)), seed=st.integers(0, 50))
def test_the_order_of_rows_does_not_matter(order, seed):
    measured = noisy(seed)
    before, after = one(VELOCITY, measured), one(VELOCITY[order], measured[order])
    np.testing.assert_allclose(after.parameters.as_array(), before.parameters.as_array(), rtol=1e-4)


@settings(max_examples=30, deadline=None)
@given(row=st.integers(0, VELOCITY.size - 1), seed=st.integers(0, 50))
def test_a_repeated_point_shifts_the_mean_torque_within_noise(row, seed):
    """A point's weight is at most 1, so its doubling moves the curve's mean by less than the point's own residual."""
    measured = noisy(seed)
    mean, sd = mean_torques([one(VELOCITY, measured)], VELOCITY)[0]
    after = one(np.append(VELOCITY, VELOCITY[row]), np.append(measured, measured[row]))
    assert abs(mean_torques([after], VELOCITY)[0, 0] - mean) < 3 * sd


def test_both_directions_are_one_curve_with_points_at_rest() -> None:
    measured = noisy(3)
    forward, backward = one(VELOCITY, measured), one(-VELOCITY, -measured)
    np.testing.assert_array_equal(forward.parameters.as_array(), backward.parameters.as_array())
    assert mean_torques([forward], -VELOCITY)[0, 0] == -mean_torques([forward], VELOCITY)[0, 0]
    # points at rest give the static torque
    velocity = np.concatenate([[0.0, -0.0], VELOCITY])
    fit = one(velocity, np.concatenate([[25.0, -25.0], eq3(FRESH, VELOCITY)]))
    np.testing.assert_allclose(fit.parameters.as_array(), FRESH, rtol=1e-5)


def test_given_deviations_are_weights_unless_the_residuals_contradict_them() -> None:
    """Three wild points with a deviation to match leave the curve where it was."""
    measured, sd = noisy(4), np.full(VELOCITY.size, 0.25)
    measured[[3, 17, 30]], sd[[3, 17, 30]] = 90.0, 1e4
    fit = one(VELOCITY, measured, sd)
    assert mean_torques([fit], VELOCITY)[0, 0] == pytest.approx(eq3(FRESH, VELOCITY).mean(), abs=0.3)
    assert mean_torques([one(VELOCITY, measured)], VELOCITY)[0, 0] > eq3(FRESH, VELOCITY).mean() + 2
    # deviations that the residuals contradict are not believed
    small, fair = (one(VELOCITY, noisy(5), np.full(VELOCITY.size, sd)) for sd in (0.01, 0.25))
    assert "are larger than torque_sd_nm" in small.message
    assert "exceed" not in fair.message
    assert small.noise == pytest.approx(one(VELOCITY, noisy(5)).noise, rel=1e-3)
    assert fair.noise == pytest.approx(0.25)


def test_eq_5_is_one_minus_r_squared():
    measured = noisy(6)
    fit = one(VELOCITY, measured)
    miss = torque(VELOCITY, fit.parameters) - measured
    assert fit.mse_percent == pytest.approx(100 * (miss**2).mean() / measured.var())
    assert fit.rmse == pytest.approx(np.sqrt((miss**2).mean()))
    assert fit.mse_percent < 5
    assert fit.acceptable


def test_what_a_curve_does_not_determine_is_said() -> None:
    # a constant torque has no error of eq 5, and no error
    fit = one(VELOCITY, np.full(VELOCITY.size, 12.0))
    assert fit.mse_percent is None
    assert fit.acceptable
    assert "stribeck_velocity" in fit.undetermined
    np.testing.assert_allclose(torque(VELOCITY, fit.parameters), 12.0, rtol=1e-6)
    # M_s -> 0 with M_s M̄_c finite: the curve is right to a millionth and M̄_c is called what it is.
    measured = 30.0 * np.exp(-4.0 / VELOCITY)
    fit = one(VELOCITY, measured)
    np.testing.assert_allclose(torque(VELOCITY, fit.parameters), measured, atol=30 * 3e-5)
    assert fit.status is StribeckFitStatus.UNDETERMINED
    assert "coulomb_ratio" in fit.undetermined
    assert fit.parameters.stribeck_velocity == pytest.approx(4.0, rel=1e-3)
    assert mean_torques([fit], VELOCITY)[0, 1] < 0.01
    # a viscous coefficient at zero is at bound
    fit = one(VELOCITY, eq3(np.array([25.0, 0.5, 3.0, 0.0]), VELOCITY) - 0.3 * VELOCITY**0.3)
    assert fit.status is StribeckFitStatus.AT_BOUND
    assert fit.parameters.viscous_coefficient == 0
    assert fit.standard_errors[3] > 0
    assert "viscous_coefficient at zero" in fit.message


@pytest.mark.parametrize("speeds", [1, 2, 3])
def test_fewer_than_four_speeds_determine_nothing(speeds):
    velocity = np.repeat(VELOCITY[[0, 10, 39]][:speeds], 4)
    fit = one(velocity, eq3(FRESH, velocity) + np.random.default_rng(7).normal(0, 0.2, velocity.size))
    assert fit.undetermined == PARAMETER_NAMES
    assert f"({speeds}) to determine" in fit.message
    mean, sd = mean_torques([fit], velocity)[0]
    assert mean == pytest.approx(eq3(FRESH, velocity).mean(), abs=0.5)
    assert sd < 0.5


def test_a_single_point_is_answered():
    fit = one([3.0], [20.0])
    mean, sd = mean_torques([fit], VELOCITY)[0]
    assert mean == pytest.approx(20.0)
    assert 5 < sd < 100
    assert "5% of the torque is assumed" in fit.message


HARD = {
    "zero": (VELOCITY, 0 * VELOCITY),
    "at rest": ([0.0, -0.0, 0.0], [20.0, -21.0, 20.0]),
    "all equal": (np.full(6, 3.0), [20.0, 21.0, 19.0, 20.0, 22.0, 20.0]),
    "close": (10 + 1e-7 * np.arange(8), np.arange(8.0)),
    "nearly close": (10 + 1e-3 * np.arange(8), np.arange(8.0)),
    "first is a spike": (VELOCITY, 20 + 30.0 * (np.arange(40) == 0)),
    "last is a spike": (VELOCITY, 20 + 30.0 * (np.arange(40) == 39)),
    "negative": (VELOCITY, -5 * VELOCITY),
    "alternating": (VELOCITY, 20 * (-1.0) ** np.arange(40)),
    "huge": (VELOCITY * 1e200, 1e300 * (1 + np.arange(40.0))),
    "tiny": (VELOCITY * 1e-200, 1e-300 * (1 + np.arange(40.0))),
    "wide": ([1e-300, 1e-5, 1.0, 1e5, 1e300], [1.0, 2.0, 3.0, 4.0, 5.0]),
    "four points": ([0.1, 1.0, 5.0, 10.0], [20.0, 18.0, 15.0, 14.0]),
}


@pytest.mark.parametrize("case", HARD)
def test_hard_input_is_answered_with_finite_numbers(case):
    _check_finite(one(*HARD[case]))


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_random_hard_curves_are_answered_with_finite_numbers(seed):
    _check_finite(fit_curves([hard_curve(np.random.default_rng(seed))])[0])


def _check_finite(fit):
    assert np.isfinite(fit.parameters.as_array()).all()
    assert (fit.parameters.as_array() >= 0).all()
    assert np.isfinite(fit.covariance).all()
    assert np.isfinite(fit.standard_errors).all()
    assert np.isfinite([*mean_torques([fit], VELOCITY)[0], fit.noise, fit.rmse]).all()
    assert (fit.status is StribeckFitStatus.UNDETERMINED) == bool(fit.undetermined)
    assert fit.message.endswith(".")


@pytest.mark.parametrize(
    ("name", "row", "bad", "rule"),
    [
        ("velocity", 3, np.nan, "finite, got nan"),
        ("torque", 0, np.inf, "finite, got inf"),
        ("torque_sd", 5, 0.0, "finite and positive, got 0.0"),
        ("torque_sd", 5, -1.0, "finite and positive, got -1.0"),
        ("torque_sd", 5, np.nan, "finite and positive, got nan"),
    ],
)
def test_an_invalid_value_is_refused_by_name_and_row(name, row, bad, rule):
    columns = {"velocity": VELOCITY.copy(), "torque": noisy(8), "torque_sd": np.ones(VELOCITY.size)}
    columns[name][row] = bad
    with pytest.raises(ValueError, match=rf"{name}\[{row}\] must be {rule}"):
        fit_curves([replace(curve(VELOCITY, noisy(8)), **columns)])


def test_empty_and_unequal_columns_are_refused():
    with pytest.raises(ValueError, match="at least one row"):
        one([], [])
    with pytest.raises(ValueError, match="velocity must have the shape of torque"):
        one([1.0, 2.0], [1.0])


def test_the_scan_is_the_non_negative_least_squares_of_another_algorithm():
    """profile() against scipy's active-set nnls at each V_S; 1e-9 of the sum of squares covers near-parallel columns."""
    rng = np.random.default_rng(9)
    for _ in range(40):
        each = hard_curve(rng)
        fastest = np.abs(each.velocity).max()
        share, folded = np.abs(each.velocity) / fastest, each.torque * np.sign(each.velocity)
        problem = make_problem(share[None], folded[None], np.ones_like(share)[None])
        logs = np.linspace(problem.low[0] + 5, problem.high[0] - 3, 15)
        found = profile(problem, logs[None]).residual[0]
        for log, ours in zip(logs, found, strict=True):
            x = np.exp(log) / share
            design = np.stack([-np.expm1(-x), np.exp(np.exp(log) - x), share**0.3], axis=1)
            witness = nnls(design, folded)[1] ** 2
            assert ours == pytest.approx(witness, abs=1e-9 * max(float(folded @ folded), 1e-12))


def test_the_jacobian_by_finite_differences():
    """∂/∂(a, b e_max, c, log V_S): central differences over 1e-6, so 1e-9 of rounding."""
    problem = make_problem((VELOCITY / VELOCITY.max())[None], noisy(10)[None] / 25, np.ones((1, VELOCITY.size)))
    optimum, _ = minimise(problem)
    analytic = jacobian(problem, optimum)[0]

    def model(coefficients, log):
        v_s, share = np.exp(log), VELOCITY / VELOCITY.max()
        a, b, c = coefficients
        return a * -np.expm1(-v_s / share) + b * np.exp(v_s - v_s / share) + c * share**0.3

    at, log, h = optimum.coefficients[0, 0], float(optimum.log_velocity[0, 0]), 1e-6
    steps = [
        (model(at + h * unit[:3], log + h * unit[3]) - model(at - h * unit[:3], log - h * unit[3])) / (2 * h)
        for unit in np.eye(4)
    ]
    np.testing.assert_allclose(analytic, np.stack(steps, axis=1), atol=1e-8)
