"""Files in parts: blocks below each other, sheets, groups and archived files are one test; and values over values."""

import io
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
import openpyxl  # type: ignore[import-untyped]
import pytest
import scipy.io
from nptdms import ChannelObject, GroupObject, TdmsWriter  # type: ignore[import-untyped]

from models.arrays import FloatArray
from service.api.rig import FileKindName, Suggestion
from service.errors import InvalidError
from service.readers.read_file import read_file, reading_of
from service.readers.table import Reading
from service.runs.suggestion import suggestion_of
from service.runs.upload import read_file_run
from tests.lab.files.draw import confirmed
from tests.lab.files.writers import Drawn

SPEEDS = [20.0, 120.0, 520.0, 1970.0]
TORQUES = {2.0: [9.1, 7.8, 6.9, 6.7], 4.0: [18.0, 15.9, 13.6, 13.7], 6.0: [27.1, 23.7, 20.4, 20.6]}
STACKED = {
    "pressure_bar": np.repeat([*TORQUES], 4),
    "speed_rpm": np.tile(SPEEDS, 3),
    "torque_nm": np.concatenate([*TORQUES.values()]),
}
ACROSS = {
    "pressure_bar": np.tile([*TORQUES], 4),
    "speed_rpm": np.repeat(SPEEDS, 3),
    "torque_nm": np.array([*TORQUES.values()]).T.reshape(-1),
}


def rows(*columns: Sequence[float | str], separator: str = ";") -> str:
    """Columns as lines."""
    return "".join(separator.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


def blocks(block: Callable[[float, list[float]], str]) -> str:
    """A text of a block for each pressure."""
    return "".join(block(pressure, torques) for pressure, torques in TORQUES.items())


def book(path: Path, sheets: Mapping[str, Sequence[Sequence[object]]]) -> None:
    """A workbook of sheets with the rows given."""
    written = openpyxl.Workbook()
    written.remove(written.active)
    for name, cells in sheets.items():
        sheet = written.create_sheet(name)
        for row in cells:
            sheet.append(list(row))
    written.save(path)


def pairs(first: Iterable[float], second: Iterable[float]) -> list[list[float]]:
    """Rows of two columns."""
    return [[float(one), float(other)] for one, other in zip(first, second, strict=True)]


def suggested(path: Path, kind: FileKindName = "stationary_stribeck") -> Suggestion:
    """What is suggested of a file, which is not read without a question."""
    with pytest.raises(InvalidError) as caught:
        read_file_run(path, filename=path.name, kind=kind, cycles=0)
    assert isinstance(caught.value.suggestion, Suggestion), caught.value.detail
    return caught.value.suggestion


def same(
    path: Path, expected: Mapping[str, FloatArray] = STACKED, kind: FileKindName = "stationary_stribeck"
) -> Suggestion:
    """What is suggested, by which the file gives the expected channels."""
    suggestion = suggested(path, kind)
    drawn = Drawn(path=path, kind=kind, truth=expected, writer="", language="")
    got = confirmed(drawn, suggestion)
    for channel, values in expected.items():
        np.testing.assert_allclose(got[channel], values, rtol=1e-9, err_msg=channel)
    return suggestion


BLOCKS = {
    "a label and its value": lambda p, m: f"Anpressdruck;{p};bar\nn [1/min];M [Nm]\n{rows(SPEEDS, m)}\n",
    "in another unit": lambda p, m: f"Pressure: {100 * p:g} kPa\nn [1/min];M [Nm]\n{rows(SPEEDS, m)}\n",
    "in a section's name": lambda p, m: f"[Level {p} bar]\nn [1/min];M [Nm]\n{rows(SPEEDS, m)}\n",
    "in comments": lambda p, m: f"# p = {p} bar\n# n[rpm];M[Nm]\n{rows(SPEEDS, m)}\n\n",
    "units in a row": lambda p, m: f"Druck {p} bar\nn;M\n1/min;Nm\n{rows(SPEEDS, m)}\n",
    "a pressure in each row": lambda p, m: f"Stufe {p:g}\np [bar];n [1/min];M [Nm]\n{rows([p] * 4, SPEEDS, m)}\n",
}


@pytest.mark.parametrize("block", BLOCKS.values(), ids=BLOCKS)
def test_blocks_below_each_other_are_one_test(tmp_path: Path, block: Callable[[float, list[float]], str]) -> None:
    path = tmp_path / "a.csv"
    path.write_text(blocks(block))
    assert same(path).table == "*"


def test_labels_within_a_table_begin_blocks(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("n [1/min];M [Nm]\n" + blocks(lambda p, m: f"p = {p} bar\n{rows(SPEEDS, m)}"))
    assert same(path).map["pressure_bar"] == "=sheets"


@pytest.mark.parametrize("beside", [False, True], ids=["below each other", "beside each other"])
def test_blocks_in_a_sheet(tmp_path: Path, beside: bool) -> None:
    book = openpyxl.Workbook()
    for number, (pressure, torques) in enumerate(TORQUES.items()):
        top, left = (0, 3 * number) if beside else (7 * number, 0)
        cells = [[f"{pressure:g} bar", None], ["n [1/min]", "M [Nm]"], *zip(SPEEDS, torques, strict=True)]
        for row, pair in enumerate(cells, 1):
            for column, cell in enumerate(pair, 1):
                book.active.cell(top + row, left + column, cell)
    book.save(tmp_path / "a.xlsx")
    assert same(tmp_path / "a.xlsx").map["pressure_bar"] == ("=columns" if beside else "=sheets")


@pytest.mark.parametrize("label", [True, False], ids=["a cell above", "a column"])
def test_sheets_whose_names_say_nothing(tmp_path: Path, label: bool) -> None:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for number, (pressure, torques) in enumerate(TORQUES.items()):
        sheet = book.create_sheet(f"Tabelle{number}")
        for row in (
            [["Druck [bar]", pressure], [], ["n [1/min]", "M [Nm]"]] if label else [["n [1/min]", "M [Nm]", "p [bar]"]]
        ):
            sheet.append(row)
        for pair in zip(SPEEDS, torques, strict=True):
            sheet.append([*pair] if label else [*pair, pressure])
    book.save(tmp_path / "a.xlsx")
    assert same(tmp_path / "a.xlsx").table == "*"


def test_sheets_of_the_same_levels_are_tests_of_their_own(tmp_path: Path) -> None:
    cells = [["p [bar]", "n [1/min]", "M [Nm]"], *np.transpose([*STACKED.values()]).tolist()]
    book(tmp_path / "a.xlsx", {"before": cells, "after": cells})
    suggestion = same(tmp_path / "a.xlsx")
    assert (suggestion.table, suggestion.confidence) == ("before", 0.5)


def test_groups_of_the_same_levels_are_tests_of_their_own(tmp_path: Path) -> None:
    with TdmsWriter(str(tmp_path / "a.tdms")) as file:
        channels = [(group, name, values) for group in ("after", "before") for name, values in STACKED.items()]
        file.write_segment([ChannelObject(*channel) for channel in channels])
    assert (same(tmp_path / "a.tdms").table, suggested(tmp_path / "a.tdms").confidence) == ("after", 0.5)


BY_SPEED = {speed: [torques[at] for torques in TORQUES.values()] for at, speed in enumerate(SPEEDS)}


def test_sheets_of_a_speed_each_are_one_test(tmp_path: Path) -> None:
    """The pressures come back in each part; the speeds do not."""
    book(tmp_path / "a.xlsx", {f"{n:g} rpm": [["p [bar]", "M [Nm]"], *pairs(TORQUES, m)] for n, m in BY_SPEED.items()})
    assert same(tmp_path / "a.xlsx", ACROSS).map["speed_rpm"] == "=sheets"


@pytest.mark.parametrize(
    "text",
    [
        "".join(f"n = {n:g} 1/min\np [bar];M [Nm]\n{rows([*TORQUES], m)}\n" for n, m in BY_SPEED.items()),
        "p [bar];" + ";".join(f"M @ {n:g} rpm [Nm]" for n in SPEEDS) + "\n" + rows([*TORQUES], *BY_SPEED.values()),
    ],
    ids=["blocks", "columns"],
)
def test_a_speed_stands_above_blocks_or_in_titles(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    same(tmp_path / "a.csv", ACROSS)


WHOLE = ("p [bar];n [1/min];M [Nm]\n", [*STACKED.values()])


def test_files_of_the_same_levels_are_tests_of_their_own(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("run1.csv", "run2.csv"):
            archive.writestr(name, WHOLE[0] + rows(*WHOLE[1]))
    suggestion = same(tmp_path / "a.zip")
    assert (suggestion.table, suggestion.confidence) == ("run1.csv", 0.5)


def test_blocks_of_the_same_levels_are_tests_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(2 * (WHOLE[0] + rows(*WHOLE[1]) + "\n"))
    assert same(tmp_path / "a.csv").table == "1"


OSCILLATING = 300 + 280 * np.sin(np.pi * np.arange(400) / 40 + 0.3)
DYNAMIC = {
    "time_s": np.arange(400) / 20,
    "pressure_bar": np.full(400, 4.0),
    "speed_rpm": OSCILLATING,
    "torque_nm": 18 - 0.004 * OSCILLATING,
}
DYNAMIC_TITLES = ["t [s]", "p [bar]", "n [1/min]", "M [Nm]"]


@pytest.mark.parametrize("titles", [";".join(DYNAMIC_TITLES), "Time;Pressure;Speed;Torque"], ids=["units", "no units"])
@pytest.mark.parametrize("between", ["", "\n{}\n"], ids=["rows alone", "titles again"])
def test_of_dynamic_tests_below_each_other_the_first_is_suggested(tmp_path: Path, titles: str, between: str) -> None:
    body = rows(*(column.tolist() for column in DYNAMIC.values()))
    (tmp_path / "a.csv").write_text(f"{titles}\n{body}{between.format(titles)}{body}")
    suggestion = same(tmp_path / "a.csv", DYNAMIC, "dynamic_stribeck")
    assert (suggestion.table, suggestion.confidence) == ("1", 0.5)


def test_sheets_of_a_channel_each_are_one_record(tmp_path: Path) -> None:
    units = {"torque_nm": "Nm", "speed_rpm": "rpm", "pressure_bar": "bar"}
    sheets = {
        channel.partition("_")[0]: [["Time [s]", f"Value [{unit}]"], *pairs(DYNAMIC["time_s"], DYNAMIC[channel])]
        for channel, unit in units.items()
    }
    book(tmp_path / "a.xlsx", sheets)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("readme.txt", "see the report\n")
        for name, (titles, *cells) in sheets.items():
            archive.writestr(f"{name}.csv", ";".join(titles) + "\n" + rows(*zip(*cells, strict=True)))
    for name in ("a.xlsx", "a.zip"):
        columns = read_file(tmp_path / name, filename=name).columns
        for channel, values in DYNAMIC.items():
            np.testing.assert_allclose(columns[channel], values, err_msg=channel)


@pytest.mark.parametrize("name", ["{} bar", "p_{}bar", "p={} bar", "level {}"])
def test_groups_of_recorders(tmp_path: Path, name: str) -> None:
    stated = "level" in name
    with TdmsWriter(tmp_path / "a.tdms") as writer, h5py.File(tmp_path / "a.h5", "w") as file:
        for pressure, torques in TORQUES.items():
            group = name.format(f"{pressure:g}")
            objects = [GroupObject(group, properties={"Pressure_bar": pressure} if stated else {})]
            folder = file.create_group(group)
            folder.attrs.update({"pressure_bar": pressure} if stated else {})
            for title, values, unit in (("speed", SPEEDS, "rpm"), ("torque", torques, "Nm")):
                objects.append(ChannelObject(group, title, np.array(values), properties={"unit_string": unit}))
                folder.create_dataset(title, data=values).attrs["unit"] = unit
            writer.write_segment(objects)
    for path in (tmp_path / "a.tdms", tmp_path / "a.h5"):
        assert same(path).map["pressure_bar"] == (
            "=sheets" if not stated else f"={'P' if 'tdms' in path.name else 'p'}ressure_bar"
        )


def test_structs_of_matlab(tmp_path: Path) -> None:
    held = {f"p{p:g}bar": {"n_rpm": np.array(SPEEDS), "M_Nm": np.array(m)} for p, m in TORQUES.items()}
    scipy.io.savemat(tmp_path / "a.mat", held)
    same(tmp_path / "a.mat")


def test_files_of_an_archive(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("readme.txt", "Test of clutch 7\n")
        for pressure, torques in TORQUES.items():
            archive.writestr(f"run_{pressure:g}bar.csv", f"n [1/min];M [Nm]\n{rows(SPEEDS, torques)}")
    assert same(tmp_path / "a.zip").map["pressure_bar"] == "=sheets"


def test_times_of_parts_go_on(tmp_path: Path) -> None:
    """Each file of an archive begins at zero."""
    part = "t [s];p [bar];n [1/min];M [Nm]\n" + rows([0, 0.1, 0.2], [{}] * 3, [100, 101, 102], [20, 21, 22])
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for pressure in (3, 5):
            archive.writestr(f"{pressure}.csv", part.replace("{}", str(pressure)))
    (tmp_path / "a.zip").write_bytes(held.getvalue())
    read = read_file(tmp_path / "a.zip", filename="a.zip", reading=Reading(table="*"))
    assert read.columns["time_s"].tolist() == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert read.columns["pressure_bar"].tolist() == [3, 3, 3, 5, 5, 5]


MATRICES = {
    "units above": ("Reibmoment in Nm\n;Druck in bar;;\nDrehzahl in 1/min;2;4;6\n", STACKED),
    "units in the titles": ("Friction torque [Nm]\nSpeed [rpm];2 bar;4 bar;6 bar\n", STACKED),
    "both in the corner": ("M [Nm]\nn [1/min] \\ p [bar];2,0;4,0;6,0\n", STACKED),
    "units below the pressures": ("Reibmoment in Nm\n;2 bar;4 bar;6 bar\nn [1/min];;;\n", STACKED),
    "p = in the titles": ("Torque (Nm) vs speed\nn (rpm);p=2bar;p=4bar;p=6bar\n", STACKED),
    "in kPa": ("Friction torque Nm;Clutch pressure kPa;;\nSpeed rpm;200;400;600\n", STACKED),
}


@pytest.mark.parametrize(("above", "expected"), MATRICES.values(), ids=MATRICES)
def test_speeds_down_and_pressures_across(tmp_path: Path, above: str, expected: Mapping[str, FloatArray]) -> None:
    path = tmp_path / "a.csv"
    path.write_text(above + rows([f"{n:.1f}" for n in SPEEDS], *TORQUES.values()))
    suggestion = same(path, expected)
    assert suggestion.map["torque_nm"].startswith("=cells")
    assert suggestion.map["pressure_bar"].startswith("=columns")


@pytest.mark.parametrize("unit", ["1/min", "[rpm]"])
def test_groups_of_a_pressure_each(tmp_path: Path, unit: str) -> None:
    """Pressures in merged cells over a torque and a temperature each; the speed's title stands beside them."""
    columns = [own for torques in TORQUES.values() for own in (torques, [80.5] * 4)]
    head = "Drehzahl;" + ";".join(f"{p:g} bar;" for p in TORQUES) + f"\n{unit}" + ";M [Nm];T [°C]" * 3 + "\n"
    (tmp_path / "a.csv").write_text(head + rows(SPEEDS, *columns))
    assert same(tmp_path / "a.csv").map["pressure_bar"] == "=columns"


def test_the_only_pressure_stands_in_a_title(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("n [rpm];M @ 2 bar [Nm]\n" + rows(SPEEDS, TORQUES[2.0]))
    same(tmp_path / "a.csv", {name: values[:4] for name, values in STACKED.items()})


def test_pressures_down_and_speeds_across(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    head = "Moment [Nm];Drehzahl [1/min]\nDruck [bar];" + ";".join(f"{n:.0f}" for n in SPEEDS) + "\n"
    path.write_text(head + "".join(f"{p};" + ";".join(map(str, m)) + "\n" for p, m in TORQUES.items()))
    same(path, ACROSS)


OTHER_UNITS = {
    "a row of units": "bar;1/min;Nm\n{}kPa;1/min;Nm\n{}",
    "titles and units": "bar;1/min;Nm\n{}\np;n;M\nkPa;1/min;Nm\n{}",
    "titles with units": "{}\np [kPa];n [1/min];M [Nm]\n{}",
}


@pytest.mark.parametrize("form", OTHER_UNITS.values(), ids=OTHER_UNITS)
def test_units_that_change_within_a_table_are_refused(tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.csv"
    titles = "p;n;M\n" if form.startswith("bar") else "p [bar];n [1/min];M [Nm]\n"
    path.write_text(titles + form.format(rows([2] * 4, SPEEDS, TORQUES[2]), rows([400] * 4, SPEEDS, TORQUES[4])))
    with pytest.raises(InvalidError, match="other titles or units") as caught:
        read_file_run(path, filename="a.csv", kind="stationary_stribeck", cycles=0)
    assert caught.value.suggestion is None


def test_a_profile_keeps_the_parts(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(blocks(BLOCKS["a label and its value"]))
    suggestion = suggestion_of(path, filename="a.csv", reading=Reading())
    assert suggestion is not None
    run = read_file_run(path, filename="a.csv", kind=None, cycles=0, profile=suggestion.profile)
    assert run.channels["pressure_bar"].tolist() == STACKED["pressure_bar"].tolist()


def test_a_label_that_one_block_lacks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    text = blocks(lambda p, m: f"Druck;{p}\nn [1/min];M [Nm]\n{rows(SPEEDS, m)}\n").replace("Druck;4.0", "Stufe;4.0")
    path.write_text(text)
    with pytest.raises(InvalidError, match="the value beside 'Druck'"):
        read_file(path, filename="a.csv", reading=reading_of("pressure_bar:=Druck", table="*"))
