"""The identification against other optimisers, and what its uncertainties promise against what they hold."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.optimize import Bounds, least_squares, minimize

from models.arrays import FloatArray
from models.friction.identification import StribeckFit, StribeckFitStatus, fit_curves, mean_torques
from models.friction.stribeck import PARAMETER_NAMES
from models.records.runs import Curve
from tests.models.friction.stribeck_curves import VELOCITY, clutch, curve, eq3, hard_curve

pytestmark = pytest.mark.slow

SEED = 20131107
#: Residual sums are compared as shares of the sum of squared torques, noise of 1 % being 1e-4. The identification gives
#: some away knowingly: M_s is held at 1e-6 of the torque, V_S within 1e-5 and 100 times the speeds, and the last parabola
#: misses by 1e-3 in log V_S where a column drops out within it: 1.1e-8 at worst in 6,000 curves. A local optimum that is
#: missed costs 1e-6 and more.
GIVEN_AWAY = 3e-8
#: 1,000 intervals of 90 % hold the truth in 90 % of cases with a standard deviation of 0.95 %: three of them.
CURVES, COVERAGE, WITHIN = 1000, 0.90, 0.03


def _residuals(x: FloatArray, speed: FloatArray, torque: FloatArray) -> FloatArray:
    return eq3(x, speed) - torque


def _jacobian(x: FloatArray, speed: FloatArray, _torque: FloatArray) -> FloatArray:
    e = np.exp(-x[2] / speed)
    return np.stack([1 + (x[1] - 1) * e, x[0] * e, -x[0] * (x[1] - 1) * e / speed, speed**0.3], axis=1)


def _starts(speed: FloatArray, torque: FloatArray, rng: np.random.Generator) -> list[FloatArray]:
    level = max(float(np.abs(torque).mean()), 1e-3)
    sensible = np.array([level, 0.8, float(np.median(speed)), 0.1 * level])
    spread = np.exp(rng.normal(0.0, [0.5, 0.7, 1.5, 1.0], size=(3, 4)))
    return [sensible, *(sensible * spread)]


def _folded(one: Curve) -> tuple[FloatArray, FloatArray]:
    return np.abs(one.velocity), one.torque * np.sign(one.velocity)


def _sum_of_squares(fit: StribeckFit) -> float:
    return fit.rmse**2 * fit.points


def _multistart(one: Curve, rng: np.random.Generator) -> float:
    speed, torque = _folded(one)
    best = np.inf
    for start in _starts(speed, torque, rng):
        found = least_squares(
            _residuals, start, jac=_jacobian, bounds=(0, np.inf), args=(speed, torque), x_scale="jac", max_nfev=200
        )
        best = min(best, 2 * found.cost)
    return best


def _interior_point(one: Curve, rng: np.random.Generator) -> float:
    speed, torque = _folded(one)
    scale = max(float((torque**2).sum()), 1e-9)

    def objective(x: FloatArray) -> float:
        return float((_residuals(x, speed, torque) ** 2).sum()) / scale

    def slope(x: FloatArray) -> FloatArray:
        return 2 * _jacobian(x, speed, torque).T @ _residuals(x, speed, torque) / scale

    found = minimize(
        objective,
        _starts(speed, torque, rng)[0],
        jac=slope,
        hess=lambda x: 2 * _jacobian(x, speed, torque).T @ _jacobian(x, speed, torque) / scale,
        method="trust-constr",
        bounds=Bounds(0, np.inf, keep_feasible=True),
        options={"maxiter": 150},
    )
    return objective(np.maximum(found.x, 0.0)) * scale


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::RuntimeWarning")  # the witnesses warn on degenerate curves
@pytest.mark.parametrize(("witness", "curves"), [(_multistart, 250), (_interior_point, 50)])
def test_never_a_worse_optimum_than_a_local_optimiser(witness, curves) -> None:
    """Four starts of bounded least squares; the paper's own interior point method from one start on a subset."""
    rng = np.random.default_rng(SEED)
    tests = [hard_curve(rng) for _ in range(curves)]
    fits = fit_curves(tests)
    gaps = np.array(
        [
            (_sum_of_squares(fit) - witness(one, rng)) / max(float((one.torque**2).sum()), 1e-9)
            for one, fit in zip(tests, fits, strict=True)
        ]
    )
    short = np.mean(gaps < -1e-6)
    print(f"worst gap {gaps.max():.1e} of the sum of squares, the witness falls short in {short:.0%}")
    assert gaps.max() <= GIVEN_AWAY
    assert short > 0.02, "the curves are too easy: a local optimiser would pass this test as well"


def _simulated(noise: float, seed: int = SEED) -> tuple[FloatArray, FloatArray, FloatArray]:
    """True parameters [CURVES, 4], true torque and noisy torque [CURVES, 40]; noise is a share of the torque."""
    rng = np.random.default_rng(seed)
    truth = clutch(rng.uniform(4, 7, CURVES), rng.uniform(0, 1, CURVES), rng)
    torque = eq3(truth, VELOCITY)
    return truth, torque, torque * (1 + noise * rng.standard_normal(torque.shape))


def _coverage(fits: Sequence[StribeckFit], truth: FloatArray, shrink: float = 1.0) -> FloatArray:
    """[5]: the share of intervals, estimate ± 1.645 standard errors, that hold each parameter and the mean torque."""
    estimate = np.array([fit.parameters.as_array() for fit in fits])
    width = 1.645 * shrink * np.array([fit.standard_errors for fit in fits])
    means = mean_torques(fits, VELOCITY)
    miss = np.abs(means[:, 0] - eq3(truth, VELOCITY).mean(axis=1))
    held = np.column_stack([np.abs(estimate - truth) <= width, miss <= 1.645 * shrink * means[:, 1]])
    share = held.mean(axis=0)
    names = (*PARAMETER_NAMES, "mean_torque")
    print({name: round(100 * float(value), 1) for name, value in zip(names, share, strict=True)})
    return share


def test_the_error_of_eq_5_is_where_noise_alone_puts_it() -> None:
    """Mean of eq. 5 over 1,000 curves: noise variance (n - 4)/n over the variance of torque; 36 degrees of freedom a
    curve leave the ratio a deviation of 0.75 %, so 2.5 % is over three of them."""
    _, torque, noisy = _simulated(0.01)
    fits = fit_curves([curve(VELOCITY, row) for row in noisy])
    expected = 100 * (0.01**2 * torque**2).mean(axis=1) * (36 / 40) / noisy.var(axis=1)
    found = np.array([fit.mse_percent for fit in fits])
    print(f"mean mse {found.mean():.3f} %, expected {expected.mean():.3f} %")
    assert np.mean(found / expected) == pytest.approx(1.0, abs=0.025)
    assert np.mean([fit.status is StribeckFitStatus.UNDETERMINED for fit in fits]) < 0.02


@pytest.mark.parametrize(
    ("proportional", "constant"), [(0.003, 0.0), (0.01, 0.0), (0.02, 0.0), (0.0, 0.2), (0.007, 0.15)]
)
def test_intervals_hold_the_truth_as_often_as_they_say(proportional: float, constant: float) -> None:
    """Noise as a share of the torque, in Nm, and both."""
    truth, torque, noisy = _simulated(proportional)
    noisy += constant * np.random.default_rng(SEED + 1).standard_normal(torque.shape)
    share = _coverage(fit_curves([curve(VELOCITY, row) for row in noisy]), truth)
    assert np.abs(share - COVERAGE).max() <= WITHIN


def test_intervals_with_known_deviations_hold_the_truth_and_those_too_small_are_not_believed() -> None:
    """Torque noise of 0.05 to 0.5 Nm that differs from point to point, and is given."""
    truth, torque, _ = _simulated(0.0)
    rng = np.random.default_rng(SEED)
    sd = np.exp(rng.uniform(np.log(0.05), np.log(0.5), torque.shape))
    noisy = torque + sd * rng.standard_normal(torque.shape)
    fits = fit_curves([curve(VELOCITY, y, s) for y, s in zip(noisy, sd, strict=True)])
    assert np.abs(_coverage(fits, truth) - COVERAGE).max() <= WITHIN
    # deviations given too small are not believed
    truth, torque, noisy = _simulated(0.01)
    fits = fit_curves([curve(VELOCITY, y, 0.002 * t) for y, t in zip(noisy, torque, strict=True)])
    assert np.abs(_coverage(fits, truth) - COVERAGE).max() <= WITHIN
    assert all("are larger than torque_sd_nm" in fit.message for fit in fits)


@pytest.mark.parametrize("life", [0.0, 0.8])
@pytest.mark.parametrize(("proportional", "constant"), [(0.002, 0.0), (0.0, 0.04)])
@pytest.mark.parametrize(("speeds", "within"), [(6, 0.4), (10, 0.35), (40, 0.2)])
def test_the_unbiased_covariance_is_that_of_the_errors_of_many_tests(
    speeds: int, within: float, proportional: float, constant: float, life: float
) -> None:
    """1,000 tests of one clutch: a variance of so many has a standard error of 4.5 %. Of the errors along the directions of
    the mean covariance it is that of the errors within a share that is larger with few speeds, each of which has an error
    that the curve follows. That of an interval is far from it, in one direction by half and more."""
    rng = np.random.default_rng(SEED)
    truth = clutch(np.array([5.0]), np.array([life]))[0]
    velocity = VELOCITY[np.round(np.linspace(0, VELOCITY.size - 1, speeds)).astype(int)]
    torque = eq3(truth, velocity)
    noise = (proportional * torque + constant) * rng.standard_normal((CURVES, speeds))
    fits = [fit for fit in fit_curves([curve(velocity, row) for row in torque + noise]) if not fit.undetermined]
    assert len(fits) > 0.98 * CURVES
    errors = np.array([fit.parameters.as_array() for fit in fits]) - truth
    actual = errors.T @ errors / len(fits)
    of_unbiased, of_wide = (
        np.sort(np.linalg.eigvals(np.linalg.solve(np.mean(matrices, axis=0), actual)).real)
        for matrices in ([fit.unbiased_covariance for fit in fits], [fit.covariance for fit in fits])
    )
    print("variance of the errors over the stated one, by direction:", of_unbiased, of_wide)
    assert np.abs(of_unbiased - 1.0).max() < within
    assert of_wide.min() < 0.5


def test_the_coverage_check_catches_half_a_covariance_and_a_wrong_model() -> None:
    """Negative controls: a covariance halved, and data with a viscous exponent of 0.5 instead of 0.3, which the curve takes
    up in all but its Coulomb ratio."""
    truth, _, noisy = _simulated(0.01)
    fits = fit_curves([curve(VELOCITY, row) for row in noisy])
    halved = _coverage(fits, truth, shrink=np.sqrt(0.5))
    assert (halved < COVERAGE - WITHIN).all()
    wrong_form = noisy + truth[:, 3:] * (VELOCITY**0.5 - VELOCITY**0.3)
    wrong = _coverage(fit_curves([curve(VELOCITY, row) for row in wrong_form]), truth)
    assert (np.delete(wrong, 1) < COVERAGE - WITHIN).all()
