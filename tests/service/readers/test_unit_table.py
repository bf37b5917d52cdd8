"""The fixed table of units, and units that are refused."""

import numpy as np
import pytest

from service.readers.unit_table import conversion


@pytest.mark.parametrize(
    ("channel", "unit", "value", "expected"),
    [
        ("speed_rpm", "rad/s", 2 * np.pi, 60.0),
        ("speed_rpm", "1/min", 60.0, 60.0),
        ("speed_rpm", "min⁻¹", 60.0, 60.0),
        ("torque_nm", "kNm", 0.02, 20.0),
        ("torque_nm", "N·m", 20.0, 20.0),
        ("torque_nm", "N m", 20.0, 20.0),
        ("torque_nm", "mNm", 20.0, 0.02),
        ("torque_nm", "lbf·ft", 1.0, 1.3558179483314004),
        ("pressure_bar", "mbar", 5000.0, 5.0),
        ("pressure_bar", "MPa", 0.5, 5.0),
        ("pressure_bar", "kPa", 500.0, 5.0),
        ("pressure_bar", "Pa", 5e5, 5.0),
        ("pressure_bar", "psi", 14.503773773020923, 1.0),
        ("oil_temperature_c", "degC", 85.0, 85.0),
        ("oil_temperature_c", "K", 358.15, 85.0),
        ("oil_temperature_c", "°F", 185.0, 85.0),
        ("oil_temperature_c", "℃", 85.0, 85.0),
        ("time_s", "ms", 1500.0, 1.5),
        ("time_s", "min", 2.0, 120.0),
    ],
)
def test_units_are_converted(channel: str, unit: str, value: float, expected: float) -> None:
    converted = conversion(channel, unit)
    assert converted is not None
    values = np.array([value])
    converted.apply(values)
    np.testing.assert_allclose(values, expected, rtol=1e-15, atol=1e-13)


@pytest.mark.parametrize(
    ("channel", "unit"),
    [("pressure_bar", "mPa"), ("pressure_bar", "Nm"), ("torque_nm", "MNm"), ("speed_rpm", "s"), ("speed_rpm", "kHz"),
     ("oil_temperature_c", "Pa"), ("time_s", ""), ("torque_nm", "V")],
)  # fmt: skip
def test_units_of_something_else_are_not_known(channel: str, unit: str) -> None:
    assert conversion(channel, unit) is None


@pytest.mark.parametrize(
    ("channel", "unit", "factor"),
    [("time_s", "10 ms", 0.01), ("time_s", "100ns", 1e-7), ("torque_nm", "0.1 Nm", 0.1), ("speed_rpm", "x1000 rpm", 1e3),
     ("torque_nm", "10^-3 kNm", 1.0), ("time_s", "milliseconds since 2026-11-02 08:00:00", 1e-3)],
)  # fmt: skip
def test_a_multiple_of_a_unit_is_that_many(channel: str, unit: str, factor: float) -> None:
    converted = conversion(channel, unit)
    assert converted is not None
    assert converted.factor == pytest.approx(factor)
