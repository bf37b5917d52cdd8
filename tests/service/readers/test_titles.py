"""Column titles, synonyms, units and maps -> channels, and titles that are refused."""

from pathlib import Path

import numpy as np
import pytest

from service.errors import InvalidError
from service.readers.column_names import choose, column_of, known_channel, parse_map
from service.readers.read_file import reading_of
from service.readers.table import ColumnChoice, FileColumn, Reading
from service.readers.unit_table import conversion
from tests.service.readers.sample_files import read_content


@pytest.mark.parametrize(
    ("channel", "names"),
    [
        ("torque_nm", ["Torque", "M", "Drehmoment", "TORQUE_NM", "Torque abs"]),
        ("speed_rpm", ["n", "Drehzahl", "Speed"]),
        ("pressure_bar", ["p", "Druck"]),
        ("oil_temperature_c", ["T_oil", "Öltemperatur", "Oeltemperatur", "O\u0308ltemperatur", "oil temperature"]),
        ("plate_temperature_front_c", ["T_plate", "Plate temperature front", "Lamellentemperatur vorne"]),
        ("plate_temperature_rear_c", ["T_plate_rear", "Lamellentemperatur hinten"]),
        ("time_s", ["t", "Zeit", "Absolute Time"]),
        (None, ["plate", "N", "P", "T", "m", "Mz", "", "Temperatur", "-Torque", "Torque/2", "Torque^2"]),
        (None, ["Motordrehzahl", "Pressure abs", "Absolutdruck"]),
    ],
)
def test_names_are_known(channel: str | None, names: list[str]) -> None:
    assert {name: known_channel(name) for name in names} == dict.fromkeys(names, channel)


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
    column = column_of(title)
    assert (column.name, column.unit, column.title) == (name, unit, title)


def test_columns_are_chosen_by_their_names_by_a_map_which_wins_and_by_their_group() -> None:
    absolute = [column_of("p_abs [bar]"), column_of("M [Nm]")]  # another pressure
    assert [taken.channel for taken in choose(absolute, Reading())] == ["torque_nm"]
    assert parse_map("torque_nm:a,b:c, time_s:t") == {
        "torque_nm": ColumnChoice(column="a,b:c"),
        "time_s": ColumnChoice(column="t"),
    }
    headers = [FileColumn("torque_nm"), FileColumn("Mz"), FileColumn("other")]
    (column,) = choose(headers, reading_of("torque_nm:Mz"))
    assert (column.channel, column.index) == ("torque_nm", 1)
    headers = [FileColumn("M", "Nm", "fast"), FileColumn("M", "Nm", "slow")]
    with pytest.raises(InvalidError, match="torque_nm must be one column, got fast/M and slow/M"):
        choose(headers, Reading())
    with pytest.raises(InvalidError, match="torque_nm must be one column"):
        choose(headers, reading_of("torque_nm:M"))
    assert [column.index for column in choose(headers, reading_of("torque_nm:slow/M"))] == [1]


@pytest.mark.parametrize(
    ("channel", "shown", "expected"),
    [
        ("speed_rpm", {"rad/s": 2 * np.pi, "1/min": 60.0, "min⁻¹": 60.0}, 60.0),
        ("torque_nm", {"kNm": 0.02, "N·m": 20.0, "N m": 20.0, "mNm": 2e4, "lbf·ft": 20.0 / 1.3558179483314004}, 20.0),
        ("pressure_bar", {"mbar": 1000.0, "MPa": 0.1, "kPa": 100.0, "Pa": 1e5, "psi": 14.503773773020923}, 1.0),
        ("oil_temperature_c", {"degC": 85.0, "K": 358.15, "°F": 185.0, "℃": 85.0}, 85.0),
        ("time_s", {"ms": 90_000.0, "min": 1.5}, 90.0),
    ],
)
def test_units_are_converted(channel: str, shown: dict[str, float], expected: float) -> None:
    for unit, value in shown.items():
        converted = conversion(channel, unit)
        assert converted is not None, unit
        values = np.array([value])
        converted.apply(values)
        np.testing.assert_allclose(values, expected, rtol=1e-15, atol=1e-13, err_msg=unit)


@pytest.mark.parametrize(
    ("channel", "unit", "factor"),
    [("time_s", "10 ms", 0.01), ("time_s", "100ns", 1e-7), ("torque_nm", "0.1 Nm", 0.1), ("speed_rpm", "x1000 rpm", 1e3),
     ("torque_nm", "10^-3 kNm", 1.0), ("torque_nm", "1/10 Nm", 0.1), ("pressure_bar", "10 bar", None),
     ("time_s", "milliseconds since 2026-11-02 08:00:00", 1e-3),
     *((channel, unit, None) for channel, unit in (
         ("pressure_bar", "mPa"), ("pressure_bar", "Nm"), ("torque_nm", "MNm"), ("speed_rpm", "s"), ("speed_rpm", "kHz"),
         ("oil_temperature_c", "Pa"), ("time_s", ""), ("torque_nm", "V")))],
)  # fmt: skip
def test_a_multiple_of_a_unit_is_that_many_and_a_unit_of_something_else_is_not_known(
    channel: str, unit: str, factor: float | None
) -> None:
    converted = conversion(channel, unit)
    assert (converted and converted.factor) == (factor and pytest.approx(factor))


@pytest.mark.parametrize(
    ("titles", "asked"),
    [
        ("Pressure [bar],Speed [rpm],Torque [Nm],Torque corrected [Nm]", "torque_nm"),
        ("Druck [bar],Druck korrigiert [bar],Drehzahl [1/min],M [Nm]", "pressure_bar"),
        ("Pressure [bar],Speed [rpm],Torque [Nm],Slip [rpm]", "speed_rpm"),
        ("Pressure [bar],n [rpm],Torque [Nm],delta n [rpm]", "speed_rpm"),
        ("Pressure [bar],Speed [rpm],Torque [Nm],Slip [%]", None),
        ("Pressure [bar],Speed [rpm],torque_nm,Torque corrected [Nm]", None),
    ],
)
def test_a_second_column_of_a_quantity_is_asked_about(tmp_path: Path, titles: str, asked: str | None) -> None:
    """A raw torque was taken beside a corrected one, and a motor's speed beside the slip."""
    rows = [f"2,{20 * k},{8 + 0.1 * k},{6 + 0.2 * k}" for k in range(1, 9)]
    text = "\n".join([titles, *rows]) + "\n"
    if asked is None:
        assert {"pressure_bar", "speed_rpm", "torque_nm"} <= read_content(tmp_path, text).columns.keys()
        return
    with pytest.raises(InvalidError, match=f"{asked} must be one column"):
        read_content(tmp_path, text)
