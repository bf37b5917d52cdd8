"""Names and units: the fixed table, the synonyms, and what is refused."""

import numpy as np
import pytest

from service.errors import InvalidError
from service.readers.column_names import Header, choose, header_of, known_channel, parse_map
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
    found = conversion(channel, unit)
    assert found is not None
    values = np.array([value])
    found.apply(values)
    np.testing.assert_allclose(values, expected, rtol=1e-15, atol=1e-13)


@pytest.mark.parametrize(
    ("channel", "unit"),
    [("pressure_bar", "mPa"), ("pressure_bar", "Nm"), ("torque_nm", "MNm"), ("speed_rpm", "s"), ("speed_rpm", "Hz"),
     ("oil_temperature_c", "Pa"), ("time_s", ""), ("torque_nm", "V")],
)  # fmt: skip
def test_units_of_something_else_are_not_known(channel: str, unit: str) -> None:
    assert conversion(channel, unit) is None


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("Torque", "torque_nm"), ("M", "torque_nm"), ("Drehmoment", "torque_nm"), ("TORQUE_NM", "torque_nm"),
        ("n", "speed_rpm"), ("Drehzahl", "speed_rpm"), ("Speed", "speed_rpm"),
        ("p", "pressure_bar"), ("Druck", "pressure_bar"),
        ("T_oil", "oil_temperature_c"), ("Öltemperatur", "oil_temperature_c"), ("Oeltemperatur", "oil_temperature_c"),
        ("O\u0308ltemperatur", "oil_temperature_c"), ("oil temperature", "oil_temperature_c"),
        ("t", "time_s"), ("Zeit", "time_s"),
        ("N", None), ("P", None), ("T", None), ("m", None), ("Mz", None), ("", None), ("Temperatur", None),
    ],
)  # fmt: skip
def test_names_are_known(name: str, channel: str | None) -> None:
    assert known_channel(name) == channel


@pytest.mark.parametrize(
    ("title", "name", "unit"),
    [
        ("torque [Nm]", "torque", "Nm"), ("torque(Nm)", "torque", "Nm"), ("n [1/min]", "n", "1/min"),
        ("M / Nm", "M", "Nm"),
        ("n/1/min", "n", "1/min"), ("Druck in bar", "Druck", "bar"), ("speed_rad_s", "speed", "rad_s"),
        ("torque_nm", "torque_nm", None),
        ("T_oil [°C]", "T_oil", "°C"), ("torque [-]", "torque", None), ("Torque Nm", "Torque Nm", None),
        ("a/b", "a/b", None),
    ],
)  # fmt: skip
def test_titles_hold_names_and_units(title: str, name: str, unit: str | None) -> None:
    assert header_of(title) == Header(name, unit)


def test_a_map_may_name_what_holds_commas_and_colons() -> None:
    assert parse_map("torque_nm:a,b:c, time_s:t") == {"torque_nm": "a,b:c", "time_s": "t"}


def test_a_map_wins_over_names_and_states_the_unit() -> None:
    headers = [Header("torque_nm"), Header("Mz"), Header("other")]
    assert [(each.channel, each.index) for each in choose(headers, "torque_nm:Mz")] == [("torque_nm", 1)]


def test_equal_names_are_told_apart_by_their_group() -> None:
    headers = [Header("M", "Nm", "fast"), Header("M", "Nm", "slow")]
    with pytest.raises(InvalidError, match="torque_nm must be one column, got fast/M and slow/M"):
        choose(headers, None)
    with pytest.raises(InvalidError, match="torque_nm must be one column"):
        choose(headers, "torque_nm:M")
    assert [each.index for each in choose(headers, "torque_nm:slow/M")] == [1]
