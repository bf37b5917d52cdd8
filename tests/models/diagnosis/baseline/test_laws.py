"""The baseline: its curve and loops against `stribeck` and `loops.lag_laws`, and how its Coulomb ratio falls."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from models.degradation.general_order import progress_fraction
from models.diagnosis.baseline.laws import (
    ATTRACTOR,
    BLOCK,
    FALL,
    KAPPA,
    LOG_CURVATURE,
    POWERS,
    RATIO,
    Frame,
    Laws,
    curve,
    falling_weight,
)
from models.diagnosis.baseline.prediction import predict
from models.diagnosis.criteria import CURVATURE_BOUNDS, EXPONENTIAL, USUAL_CURVATURE
from models.diagnosis.design.design import build_design
from models.diagnosis.noise.estimate import first_noise
from models.diagnosis.pooled_fit.gauss_newton import fit
from models.diagnosis.pooled_fit.problem import FitProblem, priors_of
from models.friction.stribeck import StribeckParameters, torque
from models.loops.lag_laws import attractor_torque
from tests.models.diagnosis.campaigns import campaign, start_of, with_theta


def test_the_curve_is_that_of_eq_3() -> None:
    velocity = np.linspace(0.1, 12.0, 30)
    parameters = StribeckParameters(
        static_torque=22.0, coulomb_ratio=0.6, stribeck_velocity=4.0, viscous_coefficient=1.5
    )
    found = curve(velocity, np.tile(parameters.as_array(), (velocity.size, 1)))
    np.testing.assert_allclose(found, torque(velocity, parameters), rtol=1e-12)


@pytest.mark.parametrize("attractor", [40.0, 250.0, 4000.0])
def test_loops_are_the_attractor_law_in_its_periodic_state(attractor: float) -> None:
    design = build_design(campaign(2, cycles=(0.0,), noise=0.0, gain=0.0))
    prediction = predict(design, with_theta(start_of(design), KAPPA, np.log(attractor)))
    points = prediction.scene.points
    first = points.loop == 0
    parameters = StribeckParameters.from_array(prediction.scene.parameters[first][0])
    frequency = points.angular_frequency[first][0]
    time = np.linspace(0.0, 3 * 2 * np.pi / frequency, 60_001)
    phase = frequency * time
    velocity = np.interp(phase % (2 * np.pi), points.phase[first], points.velocity[first], period=2 * np.pi)
    course = attractor_torque(time, velocity, parameters, attractor)
    last = time > time[-1] - 2 * np.pi / frequency
    order = np.argsort(phase[last] % (2 * np.pi))
    expected = np.interp(points.phase[first], (phase[last] % (2 * np.pi))[order], course[last][order])
    assert np.abs(prediction.lag.torque[0] - expected).max() < 2e-3 * expected.max()


def test_a_bare_truth_is_fitted_to_a_thousandth() -> None:
    design = build_design(campaign(3, noise=0.0, gain=0.0))
    start = start_of(design)
    priors = priors_of(design, start.theta, start.frame)
    found = fit(FitProblem(design=design, noise=first_noise(design), priors=priors), start)
    assert np.sqrt(np.mean(found.residual**2)) < 1e-3 * np.median(design.torque)


@pytest.mark.parametrize("exponent", [0.5, 0.8, 1.0, 1.5])
@pytest.mark.parametrize("half", [0.05, 0.1, 0.15, 0.2])
def test_what_c_drifts_early_in_life_is_followed(exponent: float, half: float) -> None:
    """Eq. 6, half of what it does within the test done after `half` of it: rms at six states, by two courses."""

    def done(x: np.ndarray | float, log_scale: float) -> np.ndarray:
        return progress_fraction(x, float(np.exp(log_scale)), exponent)

    scale = brentq(lambda each: float(done(half, each) - 0.5 * done(1.0, each)), -9.0, 9.0)
    x, last = np.linspace(0.0, 1.0, 6), 20_000.0
    drift = done(x, scale) / done(1.0, scale)
    frame = Frame(lowest=4e5, highest=7e5, last=last, loop_pressures=np.array([5e5]), reference_velocity=6.0)
    laws = Laws(theta=np.zeros(ATTRACTOR + 1 + POWERS), frame=frame)
    courses = laws.log_attractor(np.full(x.size, 5e5), last * x)[1][:, :2]

    def missed(columns: np.ndarray) -> float:
        return float(np.sqrt(np.mean((columns @ np.linalg.lstsq(columns, drift, rcond=None)[0] - drift) ** 2)))

    assert missed(courses) < 0.03
    # the control: a parabola of cycles
    assert missed(np.stack([x, x * x], axis=1)) > 0.045


@pytest.mark.parametrize("curvature", [EXPONENTIAL, 0.25, 1.0])
def test_the_coulomb_ratio_falls_as_an_exponential_as_a_hyperbola_or_between(curvature: float) -> None:
    """The limits against their own formulas, P⁻ for p_0, and a straight line below P⁻; derivatives against differences."""
    lowest, span = 4e5, 3e5
    high = np.array([-1.0, -0.6, 0.0, 0.3, 1.0])
    fall = np.array([np.log(lowest), np.log(curvature)])
    weight, slopes = falling_weight(high, span, fall)
    pressure = lowest + span * high[2:]
    known = {EXPONENTIAL: np.exp(-(pressure - lowest) / lowest), 1.0: lowest / pressure}
    if curvature in known:
        expected = (known[curvature] - known[curvature][-1]) / (1 - known[curvature][-1])
        np.testing.assert_allclose(weight[2:], expected, atol=2e-3)
    assert weight[[2, 4]] == pytest.approx([1.0, 0.0])
    near = falling_weight(np.array([-1e-6, 1e-6]), span, fall)[0]
    assert (weight[0] - 1.0) / 1.0 == pytest.approx((weight[1] - 1.0) / 0.6)
    assert (near[0] - near[1]) / 2e-6 == pytest.approx(weight[0] - 1.0, rel=1e-4)
    if curvature > EXPONENTIAL:  # that is its bound
        for k, step in enumerate(np.eye(2) * 1e-6):
            numeric = (falling_weight(high, span, fall + step)[0] - falling_weight(high, span, fall - step)[0]) / 2e-6
            np.testing.assert_allclose(slopes[:, k], numeric, atol=1e-6)


@pytest.mark.parametrize("levels", [(4e5, 7e5), (6.25e5, 7e5)])
def test_far_below_two_pressures_the_ratio_stays_one(levels: tuple[float, float]) -> None:
    """A quarter of the lowest, as advised tests have it: two pressures say nothing of how the ratio falls."""
    frame = Frame(lowest=levels[0], highest=levels[1], last=1e4, loop_pressures=np.zeros(0), reference_velocity=6.0)
    fall = np.array([np.log(0.6 * frame.span), np.log(USUAL_CURVATURE)])
    high = np.array([(0.25 * levels[0] - levels[0]) / frame.span])
    weight = float(falling_weight(high, frame.span, fall)[0][0])
    assert 1.0 < weight < 1.0 - 3.0 * float(high[0])


def test_the_curvature_stays_within_its_bounds_wherever_a_fit_starts() -> None:
    design = build_design(campaign(3, noise=0.0, gain=0.0, loops=False, cycles=(0.0, 3000.0, 9000.0)))
    start = start_of(design)
    steep = with_theta(start, FALL, (np.log(0.05 * start.frame.span), np.log(4.9)))
    noise = first_noise(design)
    problem = FitProblem(
        design=replace(design, torque=predict(design, steep).torque),
        noise=replace(noise, deviation=0.02 * noise.deviation),
        priors=priors_of(design, start.theta, start.frame),
    )
    for begun in (0.25, 20.0):
        found = fit(problem, with_theta(start, LOG_CURVATURE, np.log(begun)))
        assert CURVATURE_BOUNDS[0] <= np.exp(found.laws.theta[LOG_CURVATURE]) <= CURVATURE_BOUNDS[1] * (1 + 1e-9)


def test_a_ratio_that_falls_as_a_hyperbola_is_followed_and_an_exponential_is_not_enough() -> None:
    design = build_design(campaign(3, noise=0.0, gain=0.0))
    start = start_of(design)
    curved = with_theta(start, slice(RATIO * BLOCK, RATIO * BLOCK + 2), (0.9, 0.6))
    curved = with_theta(curved, FALL, (np.log(start.frame.lowest / 2), np.log(1.5)))
    priors = priors_of(design, start.theta, start.frame)
    problem = FitProblem(
        design=replace(design, torque=predict(design, curved).torque), noise=first_noise(design), priors=priors
    )
    held = replace(priors, free=priors.free & (np.arange(start.theta.size) != LOG_CURVATURE))
    free = fit(problem, start)
    exponential = fit(replace(problem, priors=held), with_theta(start, LOG_CURVATURE, np.log(EXPONENTIAL)))
    assert np.abs(free.residual).max() < 0.2 * np.abs(exponential.residual).max()
