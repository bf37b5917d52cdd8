"""The two laws of lag against stiff integrators and their limits."""

import math

import numpy as np
import pytest

from models.friction.stribeck import StribeckParameters
from models.loops.attractor import attractor_torque
from models.loops.squeeze_film import film_speed, film_time_at, squeeze_film_torque
from tests.models.loops.dynamic_records import (
    FALLING,
    FINE,
    GEOMETRY,
    PERIOD,
    RISING,
    SWING,
    attractor,
    attractor_area,
    curve,
    dense_area,
    squeezed,
    velocity,
)

# --- The attractor law against a stiff integrator and closed forms, and the area of its loop to first order.

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


# --- The squeezed film against a stiff integrator of eq. 7 and its limits.


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("film_time", [0.01, 0.1, 1.0])
def test_film_against_a_stiff_integrator_of_eq_7(parameters, film_time):
    # the witness integrates the balance of loads with eq. 7 in the film's thickness, not in w or z
    found = squeeze_film_torque(FINE, velocity(FINE), parameters, film_time)
    assert np.abs(found - squeezed(parameters, film_time)(FINE))[PERIOD].max() < 1e-3


def test_film_limits():
    v = velocity(FINE)
    assert np.abs(film_speed(FINE, v, 1e-7) - v)[v > 0.1].max() < 1e-3
    slow = film_speed(FINE, v, 1e4)
    assert np.ptp(slow) < 0.02 * slow.mean()
    assert film_time_at(5e5, 0.1) == pytest.approx(0.1)
    assert film_time_at(7e5, 0.1) > film_time_at(4e5, 0.1)
    with pytest.raises(ValueError, match="film_time must be positive"):
        film_speed(FINE, v, -1.0)


@pytest.mark.parametrize("parameters", [FALLING, RISING])
@pytest.mark.parametrize("film_time", [0.01, 0.1])
def test_film_is_higher_accelerating_whatever_the_slope(parameters, film_time):
    v = velocity(FINE)
    found = squeeze_film_torque(FINE, v, parameters, film_time)
    assert dense_area(found) > 0
    assert dense_area(squeeze_film_torque(FINE, v, parameters, 10 * film_time)) > 0
    # away from the turning points, where the film still remembers the other direction
    rising = np.cos(0.2 * math.pi * FINE) > 0.3
    falling = np.cos(0.2 * math.pi * FINE) < -0.3
    off = found - curve(v, parameters)
    assert off[PERIOD][rising[PERIOD]].min() > 0
    assert off[PERIOD][falling[PERIOD]].max() < 0
    # the control: contact alone, S at the film's speed without the shear of the thinner film, is wrong where S rises
    contact_only = curve(film_speed(FINE, v, film_time), RISING)
    assert dense_area(contact_only) < 0
