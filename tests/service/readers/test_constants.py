"""A channel that no column holds: by the map's word, in the header, in the titles of columns, in the names of sheets."""

from pathlib import Path

import numpy as np
import pytest
import xlsxwriter  # type: ignore[import-untyped]
from fastapi.testclient import TestClient

from service.errors import InvalidError
from service.readers.read_file import preview_file, read_file, reading_of
from service.readers.table import Reading
from service.runs.suggestion import suggestion_of
from service.runs.upload import reading_with
from tests.service.readers.sample_files import read_content

SPEEDS = [20.0, 120.0, 520.0, 1970.0]
TORQUES = {3.0: [12.5, 12.1, 11.9, 11.6], 5.0: [20.9, 20.4, 19.8, 19.2], 7.0: [29.1, 28.5, 27.9, 27.2]}
ONE = "n [1/min];M [Nm]\n" + "".join(f"{n};{m}\n" for n, m in zip(SPEEDS, TORQUES[5.0], strict=True))
STACKED = {
    "pressure_bar": np.repeat([*TORQUES], 4),
    "speed_rpm": np.tile(SPEEDS, 3),
    "torque_nm": np.concatenate([*TORQUES.values()]),
}


@pytest.mark.parametrize(
    ("mapped", "pressure"),
    [("=5", 5.0), ("=5 bar", 5.0), ("= 5,5 bar", 5.5), ("=500 kPa", 5.0), ("=0.5 MPa", 5.0), ("=5.0", 5.0)],
)
def test_a_constant_is_a_channel_in_the_unit_that_is_stated(tmp_path: Path, mapped: str, pressure: float) -> None:
    read = read_content(tmp_path, ONE, f"pressure_bar:{mapped}")
    assert read.columns["pressure_bar"].tolist() == pytest.approx([pressure] * 4)
    assert read.columns["torque_nm"].tolist() == TORQUES[5.0]


@pytest.mark.parametrize(
    ("above", "label"),
    [("Druck;5 bar", "Druck"), ("Pressure [kPa]: 500", "Pressure [kPa]"), ("Pressure [kPa];500", "pressure"),
     ("Anpressdruck = 5,0 bar", "Anpressdruck"), ("p:;5", "p")],
)  # fmt: skip
def test_a_value_in_the_header_is_taken_by_its_label(tmp_path: Path, above: str, label: str) -> None:
    read = read_content(tmp_path, f"Prüfer;Meier\n{above}\n\n{ONE}", f"pressure_bar:={label}")
    assert read.columns["pressure_bar"].tolist() == pytest.approx([5.0] * 4)


@pytest.mark.parametrize(
    ("mapped", "words"),
    [("=5 Nm", "must be a number in one of bar"), ("=Druck", "where there are: 'Temperatur'"), ("=", "where there are"),
     ("=Temperatur", "the value '80 °C': it must be a number in one of bar")],
)  # fmt: skip
def test_a_constant_that_is_not_clear_is_refused(tmp_path: Path, mapped: str, words: str) -> None:
    with pytest.raises(InvalidError, match="map") as caught:
        read_content(tmp_path, f"Temperatur;80 °C\n\n{ONE}", f"pressure_bar:{mapped}")
    assert words in caught.value.detail or not mapped[1:]


@pytest.mark.parametrize(
    "form",
    ["M @ {p:g} bar [Nm]", "M ({p:g} bar) [Nm]", "M_{p:g}bar [Nm]", "Torque at {p:g} bar [Nm]", "{p:g} bar M [Nm]"],
)
@pytest.mark.parametrize("own_speeds", [False, True])
def test_values_in_the_titles_of_columns_make_a_part_each(tmp_path: Path, form: str, own_speeds: bool) -> None:
    titles, columns = ["n [1/min]"], [SPEEDS]
    for pressure, torques in TORQUES.items():
        titles += [f"n ({pressure:g} bar) [1/min]"] * own_speeds + [form.format(p=pressure)]
        columns += [SPEEDS] * own_speeds + [torques]
    if own_speeds:
        titles, columns = titles[1:], columns[1:]
    content = ";".join(titles) + "\n" + "".join(";".join(map(str, row)) + "\n" for row in zip(*columns, strict=True))
    (tmp_path / "asked").write_text(content, encoding="utf-8")
    suggestion = suggestion_of(tmp_path / "asked", filename="a.csv", reading=Reading())
    assert suggestion is not None
    assert suggestion.map["pressure_bar"] == "=columns"
    read = read_content(tmp_path, content, "pressure_bar:=columns")
    assert {name: column.tolist() for name, column in read.columns.items()} == {
        name: values.tolist() for name, values in STACKED.items()
    }
    (notice,) = read.notices
    assert notice.message == "pressure_bar is 3, 5, 7 bar by the columns: their rows were read one below the other"


def test_titles_without_values_or_with_other_columns_for_each_are_refused(tmp_path: Path) -> None:
    for content in (ONE, "n [rpm];M 3 bar [Nm];Mz 5 bar [Nm]\n20;1;2\n"):
        with pytest.raises(InvalidError, match="the values in the titles of columns"):
            read_content(tmp_path, content, "pressure_bar:=columns")


def test_values_in_the_names_of_sheets_make_a_part_each(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    with xlsxwriter.Workbook(path) as book:
        book.add_worksheet("Notes").write_row(0, 0, ["Prüfer", "Meier"])
        for pressure, torques in TORQUES.items():
            sheet = book.add_worksheet(f"Kennlinie {pressure:g} bar")
            sheet.write_row(0, 0, ["n [1/min]", "M [Nm]"])
            for row, cells in enumerate(zip(SPEEDS, torques, strict=True), 1):
                sheet.write_row(row, 0, cells)
    reading = reading_of("pressure_bar:=sheets")
    read = read_file(path, filename="a.xlsx", reading=reading)
    assert {name: column.tolist() for name, column in read.columns.items()} == {
        name: values.tolist() for name, values in STACKED.items()
    }
    shown = preview_file(path, filename="a.xlsx", reading=reading)
    assert [(column["title"], column["channel"]) for column in shown["columns"]] == [
        ("n [1/min]", "speed_rpm"), ("M [Nm]", "torque_nm"), ("=sheets", "pressure_bar"),
    ]  # fmt: skip


def test_a_profile_keeps_a_constant(client: TestClient) -> None:
    """The preview's profile has it, and finds the next file of the rig."""
    given = {"filename": "bench_100.csv", "kind": "stationary_stribeck", "cycles": 100}
    shown = client.post("/v1/import/preview", params=given | {"map": "pressure_bar:=5 bar"}, content=ONE).json()
    assert (shown["missing"], shown["problem"]) == ([], None)
    assert {"title": "=5 bar", "channel": "pressure_bar"}.items() <= shown["profile"]["columns"][-1].items()
    assert client.post("/v1/rigs", json=shown["profile"] | {"name": "bench"}).status_code == 201
    again = client.post("/v1/import/preview", params=given | {"filename": "bench_200.csv"}, content=ONE).json()
    assert (again["rig"], again["problem"], again["channels"]["pressure_bar"]) == ("bench", None, [5.0] * 4)
    receipt = client.post(
        "/v1/clutches/c1/runs/file", params={"rig": "bench", "filename": "bench_300.csv"}, content=ONE
    )
    assert receipt.status_code == 201, receipt.text
    assert receipt.json()["cycles"] == 300


@pytest.mark.parametrize(
    ("title", "factor"), [("SECONDS", 1.0), ("sec", 1.0), ("milliseconds", 1e-3), ("Sekunden", 1.0)]
)
def test_a_title_that_is_a_unit_of_time_names_the_time(tmp_path: Path, title: str, factor: float) -> None:
    content = f"{title};p [bar];n [rpm];M [Nm]\n0;5;100;20\n1;5;101;21\n2;5;102;21\n"
    assert read_content(tmp_path, content).columns["time_s"].tolist() == pytest.approx([0, factor, 2 * factor])
    names = {"Clutch pressure": ("bar", 5), "Slip speed": ("rpm", 100), "Clutch torque": ("Nm", 20)}
    rows = [f"{t};{name};{value + t};{unit}" for t in range(3) for name, (unit, value) in names.items()]
    long = "\n".join([f"{title};PID;VALUE;UNITS", *rows]) + "\n"
    assert read_content(tmp_path, long).columns["time_s"].tolist() == pytest.approx([0, factor, 2 * factor])


UNTIMED = "n [1/min];M [Nm];p [bar]\n" + "".join(f"{300 + k % 200};{20 + 0.01 * (k % 200)};4\n" for k in range(600))


@pytest.mark.parametrize("stated", ["=100 Hz", "=10 ms", "=0.1 kHz", "=0,01 s", "=f_A"])
def test_a_rate_or_a_step_stands_for_times(tmp_path: Path, stated: str) -> None:
    read = read_content(tmp_path, f"f_A;100;Hz\n{UNTIMED}", f"time_s:{stated}")
    np.testing.assert_allclose(read.columns["time_s"], 0.01 * np.arange(600))


@pytest.mark.parametrize("stated", ["=100", "=0 Hz", "=5 bar"])
def test_what_is_no_rate_is_refused(tmp_path: Path, stated: str) -> None:
    with pytest.raises(InvalidError, match=r"must be a rate or a step|must be one of"):
        read_content(tmp_path, UNTIMED, f"time_s:{stated}")


@pytest.mark.parametrize(
    ("name", "above", "expected"),
    [
        ("a_100Hz.csv", "", "=100Hz"),
        ("a.csv", "f_A;100;Hz\n", "=f_A"),
        ("a.csv", "f_osc;0.25;Hz\n", None),
        ("a.csv", "", None),
    ],
)
def test_a_rate_that_is_stated_once_is_suggested(tmp_path: Path, name: str, above: str, expected: str | None) -> None:
    """The frequency of an oscillation is none; without a rate nothing is suggested that gives no run."""
    (tmp_path / name).write_text(above + UNTIMED)
    suggestion = suggestion_of(tmp_path / name, filename=name, reading=Reading(), kind="dynamic_stribeck")
    assert (None if suggestion is None else suggestion.map["time_s"]) == expected
    if suggestion is not None:
        profile = reading_with(suggestion.profile, Reading())
        assert read_file(tmp_path / name, filename=name, reading=profile).columns["time_s"][-1] == pytest.approx(5.99)


@pytest.mark.parametrize(
    ("titles", "mapping"),
    [
        ("M1 [Nm];M2 [Nm]", "pressure_bar:=5@M1 [Nm],pressure_bar:=1 MPa@M2"),
        ("torque_5bar;torque_10bar", "pressure_bar:=5@torque_5bar,pressure_bar:=10@torque_10bar,torque_nm:torque"),
    ],
)
def test_a_constant_of_each_column_stands_below_the_others(tmp_path: Path, titles: str, mapping: str) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{speed};{30 - speed / 100};{60 - speed / 50}" for speed in (20, 100, 500, 1000, 1500)]
    path.write_text("\n".join([f"speed_rpm;{titles}", *rows]) + "\n")
    channels = read_file(path, filename="a.csv", reading=reading_of(mapping)).columns
    assert channels["pressure_bar"].tolist() == [5.0] * 5 + [10.0] * 5
    assert channels["torque_nm"].tolist() == [29.8, 29.0, 25.0, 20.0, 15.0, 59.6, 58.0, 50.0, 40.0, 30.0]
    with pytest.raises(InvalidError, match="a column 'M9', which the table does not have"):
        read_file(
            path, filename="a.csv", reading=reading_of(f"{mapping},pressure_bar:=7@M9".replace(",torque_nm:torque", ""))
        )
