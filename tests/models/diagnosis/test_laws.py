"""The baseline: its derivatives against differences, its curve and loops against models.stribeck and models.lag."""

import numpy as np
import pytest

from models.diagnosis.baseline import frame_of, predict
from models.diagnosis.design import build_design
from models.diagnosis.fitting import fit, priors_of
from models.diagnosis.laws import KAPPA, Laws, curve
from models.diagnosis.noise import first_noise
from models.diagnosis.starting import starting_laws
from models.lag import attractor_torque
from models.stribeck import StribeckParameters, torque
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import checked_jacobian


def test_the_jacobian_is_that_of_central_differences() -> None:
    design = build_design(campaign(1, cycles=(0.0, 2000.0, 9000.0)))
    laws = starting_laws(design, frame_of(design))
    checked_jacobian(design, laws)


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
    laws = starting_laws(design, frame_of(design))
    theta = laws.theta.copy()
    theta[KAPPA] = np.log(attractor)
    prediction = predict(design, Laws(theta=theta, frame=laws.frame))
    assert prediction.lag is not None
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
    start = starting_laws(design, frame_of(design))
    found = fit(design, first_noise(design), start, priors_of(design, start.theta, start.frame))
    assert np.sqrt(np.mean(found.residual**2)) < 1e-3 * np.median(design.torque)
