"""Eq. 6 against its inverse, finite differences, its series and the kinetics that it obeys."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.degradation.general_order import (
    DegradationLaw,
    first_passage,
    progress_fraction,
    reaches,
    value,
)

scales = st.floats(1.0, 1e6)
exponents = st.floats(0.05, 20.0)
changes = st.floats(-2.0, 2.0).filter(lambda change: abs(change) > 1e-3)


def test_eq_6_by_hand() -> None:
    """(1 + 15000/5000)^-0.5 = 4^-0.5 = 1/2."""
    d = DegradationLaw(initial=0.13, change=-0.1, scale=5_000.0, exponent=0.5)
    assert value(15_000.0, d) == pytest.approx(0.08, rel=1e-15)
    assert first_passage(0.08, d) == pytest.approx(15_000.0, rel=1e-12)
    # passages broadcast and overflow to infinity without a warning
    d = DegradationLaw(initial=1.0, change=np.array([-0.4, -0.6, -0.5 - 1e-15]), scale=1e5, exponent=0.01)
    assert first_passage(0.5, d).tolist()[0] == math.inf
    assert np.isinf(first_passage(0.5, d)[2])
    # At ζ/φ = 1e-12 the series ε x (1 - (1 + ε) x/2) is exact to rounding; 1 - (1 + x)^-ε keeps four digits.
    x, exponent = 1e-12, 0.7
    series = exponent * x * (1 - (1 + exponent) * x / 2)
    assert progress_fraction(x, 1.0, exponent) == pytest.approx(series, rel=1e-14)
    assert abs((1.0 - (1.0 + x) ** -exponent) / series - 1.0) > 1e-6


@given(st.floats(-5.0, 5.0), changes, scales, exponents)
def test_at_zero_nothing_has_happened(initial: float, change: float, scale: float, exponent: float) -> None:
    d = DegradationLaw(initial=initial, change=change, scale=scale, exponent=exponent)
    assert value(0.0, d) == initial
    assert first_passage(initial, d) == 0.0


@settings(max_examples=300)
@given(changes, scales, exponents, st.floats(1e-6, 1.0 - 1e-6))
def test_inverse_round_trip(change: float, scale: float, exponent: float, share: float) -> None:
    """value(first_passage(level)) is the level again, wherever in eq. 6's range the level lies.

    Rounding of level - ξ0 by 1e-16 |ξ0| bounds the error.
    """
    d = DegradationLaw(initial=0.13, change=change, scale=scale, exponent=exponent)
    level = 0.13 + share * change
    zeta = first_passage(level, d)
    assert reaches(level, d)
    if np.isfinite(zeta):
        assert value(zeta, d) == pytest.approx(level, abs=1e-13)


@pytest.mark.parametrize(
    ("level", "change"), [(0.05, -0.06), (0.07, -0.06), (0.14, -0.06), (0.1, 0.06), (0.1, 0.0), (0.2, 0.06)]
)
def test_a_level_outside_the_range_is_never_passed(level: float, change: float) -> None:
    d = DegradationLaw(initial=0.13, change=change, scale=4_000.0, exponent=0.8)
    assert not reaches(level, d)
    assert first_passage(level, d) == math.inf


#: φ and ε of either sign.
SIGNED = pytest.mark.parametrize(
    ("scale", "exponent"),
    [(3_000.0, 0.7), (5_000.0, 4.0), (-9_000.0, -0.5), (-9_000.0, -2.0), (3_000.0, -2.0), (-9_000.0, 0.8)],
)


@SIGNED
def test_each_course_is_kinetics_of_its_order_and_passes_a_level_where_it_has_that_value(
    scale: float, exponent: float
) -> None:
    """dD/dζ = -k Dⁿ with n = 1 + 1/ε and k = ε/φ, and with both signs turned dD/dζ = k Dⁿ, by differences over half a
    cycle."""
    zeta, step, sign = np.linspace(10.0, 8_000.0, 40), 0.25, np.sign(scale) * np.sign(exponent)

    def left(at: np.ndarray) -> np.ndarray:
        return 1.0 - sign * progress_fraction(at, scale, exponent)

    rate = (left(zeta + step) - left(zeta - step)) / (2.0 * step)
    expected, first_order = (-sign * abs(exponent / scale) * left(zeta) ** n for n in (1.0 + 1.0 / exponent, 1.0))
    np.testing.assert_allclose(rate, expected, rtol=1e-5)
    assert np.abs(rate / first_order - 1.0).max() > 0.1  # the control
    # the first passage is where the course has that value
    degradation = DegradationLaw(initial=0.13, change=-0.1, scale=scale, exponent=exponent)
    for zeta in (1.0, 500.0, 8_500.0):
        assert first_passage(float(value(zeta, degradation)), degradation) == pytest.approx(zeta, rel=1e-9)
    assert first_passage(0.2, degradation) == math.inf


@pytest.mark.parametrize(
    ("name", "number", "message"),
    [
        ("scale", 0.0, "scale must not be 0"),
        ("exponent", 0.0, "exponent must not be 0"),
        ("change", math.nan, "change must"),
    ],
)
def test_coefficients_check_themselves(name: str, number: float, message: str) -> None:
    coefficients = {"initial": 1.0, "change": -0.5, "scale": 10.0, "exponent": 1.0} | {name: number}
    with pytest.raises(ValueError, match=message):
        DegradationLaw(**coefficients)
