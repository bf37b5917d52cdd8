"""Plateaus check themselves, and a curve holds the rows of its pressure level."""

import numpy as np
import pytest

from models.clutch import Geometry
from models.records.runs import Plateaus, curves_by_pressure

NOMINAL = np.repeat(np.arange(4.0, 7.01, 0.5) * 1e5, 40)


def plateaus(pressure, /, **changes):
    n = len(pressure)
    columns = {"speed": np.linspace(2, 206, n), "torque": np.full(n, 20.0)}
    return Plateaus(**({"pressure": np.asarray(pressure)} | columns | changes))


def test_curves_hold_their_rows_in_order():
    sd = np.linspace(0.1, 0.2, 280)
    curves = curves_by_pressure(plateaus(NOMINAL[::-1] + 100.0, torque_sd=sd), Geometry())
    assert [round(c.pressure) for c in curves] == [400000, 450000, 500000, 550000, 600000, 650000, 700000]
    assert curves[0].mean_pressure == pytest.approx(400100.0)
    np.testing.assert_array_equal(curves[0].torque_sd, sd[-40:])
    np.testing.assert_allclose(curves[0].velocity, np.linspace(2, 206, 280)[-40:] * 0.058)
    assert sum(c.velocity.size for c in curves) == 280


def test_curves_without_deviations_have_none():
    assert all(c.torque_sd is None for c in curves_by_pressure(plateaus(NOMINAL), Geometry()))


@pytest.mark.parametrize("name", ["pressure", "speed", "torque", "torque_sd", "oil_temperature"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_refused(name, bad):
    column = np.full(6, 3.0)
    column[4] = bad
    with pytest.raises(ValueError, match=f"{name} must be finite"):
        plateaus(np.full(6, 5e5), **{name: column})


def test_unequal_lengths_and_no_rows_are_refused():
    with pytest.raises(ValueError, match=r"speed must have the shape of torque \(6,\), got \(5,\)"):
        plateaus(np.full(6, 5e5), speed=np.ones(5))
    with pytest.raises(ValueError, match="at least one row"):
        plateaus(np.array([]))
    with pytest.raises(ValueError, match="at least one row"):
        plateaus(np.full(6, 5e5), torque=np.ones((2, 3)))
