"""Column titles, synonyms and maps -> channels, and titles that are refused."""

import pytest

from service.errors import InvalidError
from service.readers.column_names import choose, column_of, known_channel, parse_map
from service.readers.read_file import reading_of
from service.readers.table import Choice, Column, Reading


@pytest.mark.parametrize(
    ("name", "channel"),
    [
        ("Torque", "torque_nm"), ("M", "torque_nm"), ("Drehmoment", "torque_nm"), ("TORQUE_NM", "torque_nm"),
        ("n", "speed_rpm"), ("Drehzahl", "speed_rpm"), ("Speed", "speed_rpm"),
        ("p", "pressure_bar"), ("Druck", "pressure_bar"),
        ("T_oil", "oil_temperature_c"), ("Öltemperatur", "oil_temperature_c"), ("Oeltemperatur", "oil_temperature_c"),
        ("O\u0308ltemperatur", "oil_temperature_c"), ("oil temperature", "oil_temperature_c"),
        ("T_plate", "plate_temperature_front_c"), ("Plate temperature front", "plate_temperature_front_c"),
        ("Lamellentemperatur vorne", "plate_temperature_front_c"), ("T_plate_rear", "plate_temperature_rear_c"),
        ("Lamellentemperatur hinten", "plate_temperature_rear_c"), ("plate", None),
        ("t", "time_s"), ("Zeit", "time_s"),
        ("N", None), ("P", None), ("T", None), ("m", None), ("Mz", None), ("", None), ("Temperatur", None),
        ("-Torque", None), ("Torque/2", None), ("Torque^2", None), ("Motordrehzahl", None),
        ("Pressure abs", None), ("Absolutdruck", None), ("Torque abs", "torque_nm"), ("Absolute Time", "time_s"),
    ],
)  # fmt: skip
def test_names_are_known(name: str, channel: str | None) -> None:
    assert known_channel(name) == channel


def test_an_absolute_pressure_is_another_one() -> None:
    columns = [column_of("p_abs [bar]"), column_of("M [Nm]")]
    assert [taken.channel for taken in choose(columns, Reading())] == ["torque_nm"]


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


def test_a_map_may_name_what_holds_commas_and_colons() -> None:
    assert parse_map("torque_nm:a,b:c, time_s:t") == {"torque_nm": Choice(column="a,b:c"), "time_s": Choice(column="t")}


def test_a_map_wins_over_names_and_states_the_unit() -> None:
    headers = [Column("torque_nm"), Column("Mz"), Column("other")]
    assert [(column.channel, column.index) for column in choose(headers, reading_of("torque_nm:Mz"))] == [
        ("torque_nm", 1)
    ]


def test_equal_names_are_distinguished_by_their_group() -> None:
    headers = [Column("M", "Nm", "fast"), Column("M", "Nm", "slow")]
    with pytest.raises(InvalidError, match="torque_nm must be one column, got fast/M and slow/M"):
        choose(headers, Reading())
    with pytest.raises(InvalidError, match="torque_nm must be one column"):
        choose(headers, reading_of("torque_nm:M"))
    assert [column.index for column in choose(headers, reading_of("torque_nm:slow/M"))] == [1]
