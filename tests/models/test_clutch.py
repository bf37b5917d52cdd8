"""The geometry against the reference's numbers, and torque to COF and back."""

import math

import numpy as np
import pytest

from models.clutch import Geometry

RPM = 2 * math.pi / 60


def test_the_geometry_has_the_references_numbers() -> None:
    velocity = Geometry().sliding_velocity(np.array([20.0, 1970.0, -1970.0]) * RPM)
    np.testing.assert_allclose(velocity, [0.12147, 11.9652, -11.9652], rtol=1e-4)
    # 2 faces · 5 bar · 61.95 cm² · 58 mm = 359.3 Nm.
    assert Geometry().torque_per_cof(5e5) == pytest.approx(359.3, rel=1e-3)
    assert Geometry(pressure_factor=0.5, friction_faces=4).torque_per_cof(5e5) == pytest.approx(359.3, rel=1e-3)
    # an override replaces the mean radius everywhere
    geometry = Geometry(mean_radius_override=0.1)
    assert geometry.sliding_velocity(np.array([2.0])).tolist() == [0.2]
    assert geometry.torque(0.1, 5e5) == pytest.approx(Geometry().torque(0.1, 5e5) * 0.1 / 0.058)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"inner_diameter": 0.0}, "inner_diameter must be finite and positive, got 0"),
        ({"inner_diameter": math.nan}, "inner_diameter must be finite and positive"),
        ({"outer_diameter": 0.099}, "outer_diameter must exceed inner_diameter 0.099, got 0.099"),
        ({"outer_diameter": math.inf}, "outer_diameter must exceed"),
        ({"friction_faces": 0}, "friction_faces must be at least 1, got 0"),
        ({"pressure_factor": -1.0}, "pressure_factor must be finite and positive"),
        ({"mean_radius_override": 0.0}, "mean_radius_override must be finite and positive"),
    ],
)
def test_an_impossible_disc_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Geometry(**changes)


@pytest.mark.parametrize("pressure", [0.0, -1e5, math.nan, math.inf])
def test_a_torque_needs_a_pressure(pressure):
    with pytest.raises(ValueError, match="pressure must be finite and positive"):
        Geometry().torque(0.1, pressure)
