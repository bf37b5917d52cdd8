"""The squeezed film against a stiff integrator of eq. 7 and its limits."""

import math

import numpy as np
import pytest

from models.loops.squeeze_film import film_speed, film_time_at, squeeze_film_torque
from tests.models.loops.dynamic_records import (
    FALLING,
    FINE,
    PERIOD,
    RISING,
    curve,
    dense_area,
    squeezed,
    velocity,
)


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
