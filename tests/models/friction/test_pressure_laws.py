"""The pressure laws of fig. 9 against closed forms and against a general optimiser."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from models.arrays import FloatArray
from models.friction.identification import StribeckFit, fit_curves
from models.friction.pressure_laws import (
    AsymptoticPressureLaw,
    fit_asymptotic,
    fit_linear,
    fit_pressure_laws,
    law_covariance,
    laws_of,
    over_pressure,
)
from models.friction.stribeck import PARAMETER_NAMES
from models.records.runs import curves_by_pressure
from models.rig.campaign import simulated_clutch
from models.rig.stationary import stationary_test
from models.rig.truth import PROTOCOL_PRESSURES
from tests.models.rig.exact import NOISELESS


def fits_of_fresh_clutch() -> tuple[StribeckFit, ...]:
    """Noise-free fits of a simulated clutch whose parameters follow the laws exactly."""
    clutch = simulated_clutch(3)
    plateaus = stationary_test(clutch, 0, np.random.default_rng(0), NOISELESS)
    return fit_curves(curves_by_pressure(plateaus, clutch.geometry))


@pytest.mark.parametrize("decay", [0.5e5, 1.6e5, 4e5])
def test_a_falling_exponential_is_found(decay: float) -> None:
    value = 0.6 + 4.0 * np.exp(-PROTOCOL_PRESSURES / decay)
    law = fit_asymptotic(PROTOCOL_PRESSURES, value, np.ones(7))
    # where the decay is short the excess extrapolates to p = 0, so the law is compared where it was measured
    assert law(PROTOCOL_PRESSURES) == pytest.approx(value, rel=1e-5)
    assert law.asymptote == pytest.approx(0.6, rel=1e-3)


def test_no_general_optimiser_does_better() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        value = 0.6 + 4.2 * np.exp(-PROTOCOL_PRESSURES / 1.6e5) + 0.03 * rng.standard_normal(7)
        deviation = rng.uniform(0.02, 0.05, 7)
        law = fit_asymptotic(PROTOCOL_PRESSURES, value, deviation)

        def misfit(x: FloatArray, value: FloatArray = value, deviation: FloatArray = deviation) -> FloatArray:
            return np.asarray((x[0] + x[1] * np.exp(-(PROTOCOL_PRESSURES - 4e5) / x[2]) - value) / deviation)

        span = 3e5
        rivals = [
            least_squares(
                misfit, [0.5, 0.3, start * span], bounds=([0, 0, 0.05 * span], [9, 99, 20 * span]), x_scale=[1, 1, span]
            )
            for start in (0.1, 0.5, 2.0)
        ]
        ours = float(np.sum(((law(PROTOCOL_PRESSURES) - value) / deviation) ** 2))
        assert ours <= min(2 * rival.cost for rival in rivals) * (
            1 + 1e-5
        )  # the search over p_0 stops at 1e-5 of its log


def test_the_laws_of_a_simulated_clutch_from_three_pressures_on() -> None:
    clutch = simulated_clutch(3)
    laws = fit_pressure_laws(fits_of_fresh_clutch())
    assert laws.static_torque.slope > 0
    assert laws.stribeck_velocity.slope > 0
    assert laws.viscous_coefficient.slope > 0
    assert laws.coulomb_ratio.excess > 0
    found = laws.parameters(PROTOCOL_PRESSURES).as_array()
    assert found == pytest.approx(clutch.parameters(PROTOCOL_PRESSURES, 0.0).as_array(), rel=1e-3)
    # too few pressures have no law
    fits = fits_of_fresh_clutch()
    assert fit_pressure_laws(fits[:2]) is None
    untold = [replace(fit, undetermined=("stribeck_velocity",)) for fit in fits[:5]]
    assert fit_pressure_laws([*untold, *fits[5:]]) is None
    assert fit_pressure_laws([*untold[:4], *fits[4:]]) is not None


def test_laws_through_medians_are_the_laws_that_made_them_at_several_states_too() -> None:
    clutch = simulated_clutch(3)
    columns = clutch.parameters(PROTOCOL_PRESSURES, 2_000.0).as_array().T
    between = np.array([4.2e5, 6.9e5])
    expected = clutch.parameters(between, 2_000.0).as_array()
    assert laws_of(PROTOCOL_PRESSURES, columns).parameters(between).as_array() == pytest.approx(expected, rel=1e-3)
    # the negative control: the four in the wrong order
    assert laws_of(PROTOCOL_PRESSURES, columns[:, ::-1]).parameters(between).as_array() != pytest.approx(
        expected, rel=0.1
    )
    # a parameter over pressure at several states is its law at each
    states, pressures = [0.0, 2_000.0, 9_000.0], np.linspace(4e5, 7e5, 5)
    for name in PARAMETER_NAMES:
        values = np.stack([getattr(clutch.parameters(PROTOCOL_PRESSURES, state), name) for state in states], axis=1)
        expected = np.stack([getattr(clutch.parameters(pressures, state), name) for state in states], axis=1)
        assert over_pressure(name, PROTOCOL_PRESSURES, values, pressures) == pytest.approx(expected, rel=1e-3)


def test_the_band_of_a_line_is_how_far_repeated_tests_scatter() -> None:
    rng = np.random.default_rng(21)
    deviation = np.linspace(0.05, 0.2, 7)
    true = 2.0 + 3e-6 * PROTOCOL_PRESSURES
    drawn = [fit_linear(PROTOCOL_PRESSURES, true + deviation * rng.standard_normal(7), deviation) for _ in range(2_000)]
    scatter = np.cov([(law.intercept, law.slope) for law in drawn], rowvar=False)
    exact = law_covariance(fit_linear(PROTOCOL_PRESSURES, true, deviation), PROTOCOL_PRESSURES, true, deviation)
    assert scatter == pytest.approx(exact, rel=0.15)  # 1/sqrt(1000) is 3 %, a variance's error
    equal = np.full(7, deviation.mean())
    assert law_covariance(drawn[0], PROTOCOL_PRESSURES, drawn[0](PROTOCOL_PRESSURES), equal) != pytest.approx(
        exact, rel=0.15
    )


def test_the_band_of_the_falling_law_is_how_far_repeated_tests_scatter() -> None:
    rng = np.random.default_rng(22)
    law = AsymptoticPressureLaw(asymptote=0.6, excess=4.0, decay=1.6e5)
    deviation = np.full(7, 2e-3)
    true = law(PROTOCOL_PRESSURES)
    drawn = [
        fit_asymptotic(PROTOCOL_PRESSURES, true + deviation * rng.standard_normal(7), deviation)(PROTOCOL_PRESSURES)
        for _ in range(200)
    ]
    gradient = law.gradient(PROTOCOL_PRESSURES)
    covariance = law_covariance(law, PROTOCOL_PRESSURES, true, deviation)
    sd = np.sqrt(np.einsum("ni,ij,nj->n", gradient, covariance, gradient))
    assert np.std(drawn, axis=0) == pytest.approx(sd, rel=0.2)  # 1/sqrt(400) is 5 %
    assert np.all(sd < deviation)


def test_parameters_off_their_law_widen_its_band_and_a_bound_has_none() -> None:
    value = 2.0 + 3e-6 * PROTOCOL_PRESSURES
    off = value + 0.1 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])
    deviation = np.full(7, 0.01)
    near, far = (
        law_covariance(fit_linear(PROTOCOL_PRESSURES, values, deviation), PROTOCOL_PRESSURES, values, deviation)
        for values in (value, off)
    )
    assert far[0, 0] > 50.0 * near[0, 0]
    # what is held at its bound has no band
    flat = np.full(7, 0.6)
    covariance = law_covariance(
        AsymptoticPressureLaw(asymptote=0.6, excess=0.0, decay=1e5), PROTOCOL_PRESSURES, flat, np.full(7, 0.1)
    )
    assert covariance[0, 0] == pytest.approx(0.1**2 / 7)
    assert np.all(covariance[1:] == 0.0)
