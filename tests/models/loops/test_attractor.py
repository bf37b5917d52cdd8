"""The attractor law against a stiff integrator and closed forms, and the area of its loop to first order."""

import math

import numpy as np
import pytest

from models.friction.stribeck import StribeckParameters
from models.loops.attractor import attractor_torque
from tests.models.loops.dynamic_records import (
    FALLING,
    FINE,
    GEOMETRY,
    RISING,
    SWING,
    attractor,
    attractor_area,
    curve,
    dense_area,
    velocity,
)

AMPLITUDE = GEOMETRY.mean_radius * SWING


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("c", [50.0, 500.0])
def test_attractor_against_a_stiff_integrator(parameters, c):
    # second order in a step of 1 ms, and a cusp at standstill: 3e-4 Nm of 25 at worst
    found = attractor_torque(FINE, velocity(FINE), parameters, c)
    assert np.abs(found - attractor(parameters, c)(FINE)).max() < 1e-3
    many = attractor_torque(FINE, velocity(FINE), parameters, np.array([[c], [2 * c]]))
    assert np.array_equal(many[0], found)


def test_attractor_limits():
    v = velocity(FINE)
    stiff = attractor_torque(FINE, v, FALLING, 1e9)
    assert np.abs(stiff - curve(v, FALLING))[v > 1e-6].max() < 1e-4
    constant = StribeckParameters(static_torque=20.0, coulomb_ratio=1.0, stribeck_velocity=1.0, viscous_coefficient=0.0)
    time = np.array([0.0, 0.1, 0.5, 3.0])
    relaxed = attractor_torque(time, np.ones(4), constant, 40.0, start=10.0)
    assert relaxed == pytest.approx(20 - 10 * np.exp(-2 * time), rel=1e-13)
    # through zero it runs to the other side's curve
    turned = attractor_torque(time, -np.ones(4), constant, 40.0, start=20.0)
    assert turned == pytest.approx(-20 + 40 * np.exp(-2 * time), rel=1e-13)
    with pytest.raises(ValueError, match="attractor must be positive"):
        attractor_torque(time, np.ones(4), constant, 0.0)
    with pytest.raises(ValueError, match="time must not fall"):
        attractor_torque(time[::-1], np.ones(4), constant, 40.0)


@pytest.mark.parametrize(("parameters", "sign"), [(FALLING, 1), (RISING, -1)])
def test_attractor_area_to_first_order(parameters, sign):
    """-(1/C) ∮ S S' v̇² dt: what is left falls as 1/C² at least, and rising curves give negative loops."""
    t = np.linspace(0.0, 10.0, 100_001)[:-1] + 5e-5
    a = AMPLITUDE * 0.2 * math.pi * np.cos(0.2 * math.pi * t)
    left = []
    for c in (400.0, 1600.0):
        first = attractor_area(velocity(t), a, 10.0, parameters, c)
        full = dense_area(attractor_torque(FINE, velocity(FINE), parameters, c))
        assert np.sign(first) == np.sign(full) == sign
        left.append(abs(full / first - 1))
    assert left[0] < 0.01
    assert left[1] < 0.5 * left[0]
