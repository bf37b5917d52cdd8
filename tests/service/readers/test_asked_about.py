"""What is not read without a question, as any reading of it is a guess, and what is suggested."""

from pathlib import Path

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pytest

from service.api.rig import Suggestion
from service.errors import InvalidError
from service.readers.read_file import read_file, reading_of
from service.runs.upload import read_file_run
from tests.service.readers.test_parts import SPEEDS, STACKED, TORQUES, rows, same, suggested

P, N, M = (STACKED[name].tolist() for name in ("pressure_bar", "speed_rpm", "torque_nm"))
TITLES = "p [bar];n [1/min];M [Nm]\n"


def refused(tmp_path: Path, content: str, message: str) -> Suggestion | None:
    """What is suggested where a file is refused with a message."""
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(InvalidError, match=message) as caught:
        read_file_run(tmp_path / "a.csv", filename="a.csv", kind="stationary_stribeck", cycles=0)
    suggestion = caught.value.suggestion
    assert suggestion is None or isinstance(suggestion, Suggestion)
    return suggestion


@pytest.mark.parametrize("step", [5, 30, 60])
def test_rows_too_far_apart_for_samples_are_plateaus(tmp_path: Path, step: int) -> None:
    (tmp_path / "a.csv").write_text("t [s];" + TITLES + rows([step * k for k in range(12)], P, N, M))
    assert same(tmp_path / "a.csv").time == "none"


def test_several_questions_have_one_answer(tmp_path: Path) -> None:
    """No units, a mark, a decimal sign that is not clear, and a clock."""
    torques = [f"{m:.3f}".replace(".", ",") for m in M]
    torques[4] = "---"
    cells = ([f"{30 * k:.3f}".replace(".", ",") for k in range(12)], [f"{p:.3f}".replace(".", ",") for p in P])
    (tmp_path / "a.csv").write_text("t [s];P_Zyl;n_Schlupf;M_R\n" + rows(*cells, [f"{n:.0f}" for n in N], torques))
    suggestion = same(tmp_path / "a.csv", {name: np.delete(values, 4) for name, values in STACKED.items()})
    assert (suggestion.time, suggestion.missing, suggestion.decimal) == ("none", "---", ",")


@pytest.mark.parametrize("timed", [False, True])
def test_merged_cells_hold_the_value_above(tmp_path: Path, timed: bool) -> None:
    pressures = [p if k % 4 == 0 else "" for k, p in enumerate(P)]
    times = [[0.01 * k for k in range(12)]] if timed else []
    (tmp_path / "a.csv").write_text("t [s];" * timed + TITLES + rows(*times, pressures, N, M))
    assert same(tmp_path / "a.csv").missing == "above"
    lower_rate = reading_of(missing="empty")
    left = read_file(tmp_path / "a.csv", filename="a.csv", reading=lower_rate).columns["pressure_bar"].size
    assert left == (12 if timed else 3)


@pytest.mark.parametrize(
    "titles", ["Pressure [psi];Pressure [bar];n [1/min];M [Nm]\n", "Pressure;Pressure;n;M\npsi;bar;1/min;Nm\n"]
)
def test_one_quantity_in_two_units_is_one_column(tmp_path: Path, titles: str) -> None:
    (tmp_path / "a.csv").write_text(titles + rows([round(14.5038 * p, 4) for p in P], P, N, M))
    assert same(tmp_path / "a.csv").confidence > 0.9


@pytest.mark.parametrize("titles", ["M 1 [Nm];M 2 [Nm]", "Torque raw [Nm];Torque corrected [Nm]", "M;M"])
def test_of_columns_that_differ_none_is_suggested(tmp_path: Path, titles: str) -> None:
    units = "\nbar;1/min;Nm;Nm\n" if titles == "M;M" else "\n"
    given = "p;n;" if titles == "M;M" else "p [bar];n [1/min];"
    suggestion = refused(
        tmp_path, given + titles + units + rows(P, N, M, [m + 0.5 for m in M]), "must be one column|needs torque"
    )
    assert suggestion is None or suggestion.map["torque_nm"] == "Torque corrected"


def test_of_two_pressures_that_is_suggested_by_which_the_torque_goes(tmp_path: Path) -> None:
    lube = [0.7, 0.71, 0.69] * 4
    (tmp_path / "a.csv").write_text("p1 [bar];p2 [bar];n [1/min];M [Nm]\n" + rows(lube, P, N, M))
    assert suggested(tmp_path / "a.csv").map["pressure_bar"] == "p2"


def test_of_several_speeds_that_between_both_sides_is_suggested(tmp_path: Path) -> None:
    titles = "p [bar];Input speed [rpm];Output speed [rpm];Slip speed [rpm];M [Nm]\n"
    (tmp_path / "a.csv").write_text(titles + rows(P, [n + 300 for n in N], [300] * 12, N, M))
    assert same(tmp_path / "a.csv").map["speed_rpm"] == "Slip speed"


@pytest.mark.parametrize("title", ["Torque per face [Nm]", "Moment je Reibfläche [Nm]", "Torque/face [Nm]"])
def test_a_torque_of_a_face_is_none_of_the_clutch(tmp_path: Path, title: str) -> None:
    assert refused(tmp_path, f"p [bar];n [1/min];{title}\n" + rows(P, N, M), "needs torque_nm|no channel") is None


@pytest.mark.parametrize("unit", ["%FS", "%", "% v.E."])
def test_a_pressure_in_percent_is_none_in_bar(tmp_path: Path, unit: str) -> None:
    assert (
        refused(tmp_path, f"Druck [{unit}];n [1/min];M [Nm]\n" + rows([10 * p for p in P], N, M), "unit|needs") is None
    )


def test_torques_of_exactly_zero_are_asked_about(tmp_path: Path) -> None:
    torques = [0 if p == 4 else m for p, m in zip(P, M, strict=True)]
    suggestion = refused(
        tmp_path, TITLES + rows(P, N, torques), "is exactly 0, as in the 3 rows|is exactly 0, as in the 2 rows"
    )
    assert suggestion is not None
    assert suggestion.missing == "torque_nm:0"
    assert same(tmp_path / "a.csv", {name: np.delete(values, range(4, 8)) for name, values in STACKED.items()})
    assert (
        read_file(tmp_path / "a.csv", filename="a.csv", reading=reading_of(missing="none")).columns["torque_nm"].size
        == 12
    )


def test_torques_of_zero_at_standstill_or_without_pressure_are_read(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(TITLES + rows([0, 0, 0, 5, 5, 5, *P], [9, 9, 9, 0, 0, 0, *N], [0] * 6 + M))
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["torque_nm"].size == 18


def changed(channel: str, factor: float, at: slice | int) -> str:
    """The test with some values of a channel multiplied."""
    columns = {name: values.copy() for name, values in STACKED.items()}
    columns[channel][at] *= factor
    return TITLES + rows(*(np.round(values, 5).tolist() for values in columns.values()))


LEVEL = slice(4, 8)


@pytest.mark.parametrize(
    ("channel", "factor"),
    [
        ("pressure_bar", 100),
        ("pressure_bar", 14.5038),
        ("pressure_bar", 0.1),
        ("torque_nm", 1e-3),
        ("torque_nm", 0.737562),
        ("speed_rpm", np.pi / 30),
    ],
)
def test_a_level_in_another_unit_is_asked_about(tmp_path: Path, channel: str, factor: float) -> None:
    assert (
        refused(tmp_path, changed(channel, factor, LEVEL), rf"{channel}\[4\] .*are these rows in another unit") is None
    )
    read = read_file(tmp_path / "a.csv", filename="a.csv", reading=reading_of(missing="none"))
    assert read.columns[channel][4] == pytest.approx(factor * STACKED[channel][4], rel=1e-3)


MISPLACED = [(channel, factor, row) for channel in STACKED for factor in (10, 0.1) for row in (0, 5, 11)]


@pytest.mark.parametrize(("channel", "factor", "row"), MISPLACED)
def test_a_misplaced_decimal_point_is_asked_about(tmp_path: Path, channel: str, factor: float, row: int) -> None:
    assert (
        refused(tmp_path, changed(channel, factor, row), rf"{channel}\[{row}\] .*its decimal point elsewhere") is None
    )


def test_rows_of_a_record_in_another_unit_are_asked_about(tmp_path: Path) -> None:
    time = np.arange(400) / 20
    speed = 300 + 280 * np.sin(0.5 * np.pi * time)
    torque = 18 - 0.004 * speed
    speed[150:260] *= np.pi / 30
    text = "t [s];" + TITLES + rows(*(np.round(own, 4).tolist() for own in (time, 4 + 0 * time, speed, torque)))
    assert refused(tmp_path, text, r"speed_rpm\[150\] .*as 110 of 400 rows.*in another unit") is None


def test_levels_that_differ_are_read(tmp_path: Path) -> None:
    """Speeds of their own at each pressure, an open clutch with its drag, and a steep curve."""
    pressures, speeds = [0.02, 0.02, 0.02, 2, 2, 2, 4, 4, 4], [100, 500, 1000, 10, 50, 2500, 60, 300, 2000]
    torques = [0.4, 0.9, 1.4, 12, 9, 4, 22, 16, 9]
    (tmp_path / "a.csv").write_text(TITLES + rows(pressures, speeds, torques))
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["torque_nm"].tolist() == torques


@pytest.mark.parametrize("seed", range(20))
def test_noise_of_a_speed_is_no_misplaced_point(tmp_path: Path, seed: int) -> None:
    speeds = np.tile([10.0, 50, 100, 200, 1600], 4) + np.random.default_rng(seed).standard_normal(20)
    pressures = np.repeat([1.5, 3, 6, 8], 5)
    torques = np.round(4 * pressures * (0.8 + 0.3 * np.exp(-speeds / 180)), 2)
    text = TITLES + rows(pressures.tolist(), np.round(speeds, 1).tolist(), torques.tolist())
    (tmp_path / "a.csv").write_text(text)
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["speed_rpm"].size == 20


@pytest.mark.parametrize("mark", ["″", '"', '""""', "''", "dito", '-"-', "〃"])
def test_a_ditto_mark_stands_for_the_value_above(tmp_path: Path, mark: str) -> None:
    pressures = [p if k % 4 == 0 else mark for k, p in enumerate(P)]
    (tmp_path / "a.csv").write_text(TITLES + rows(pressures, N, M))
    assert same(tmp_path / "a.csv").missing == "above"


NUMBERED = [str(k + 1) for k in range(12)]


@pytest.mark.parametrize("titles", [TITLES, '"Pressure..bar.";"Speed..rpm.";"Torque..Nm."\n', "p.bar;n.rpm;M.Nm\n"])
@pytest.mark.parametrize("quote", ["", '"'])
def test_numbers_of_rows_without_a_title_are_left_out(tmp_path: Path, titles: str, quote: str) -> None:
    """As R's write.table writes them."""
    (tmp_path / "a.csv").write_text(titles + rows([f"{quote}{k}{quote}" for k in NUMBERED], P, N, M))
    columns = read_file(tmp_path / "a.csv", filename="a.csv").columns
    assert [columns[name].tolist() for name in STACKED] == [P, N, M]


@pytest.mark.parametrize("titles", ["Nr;p [bar];n [1/min]\n", "p [bar];n [1/min];M [Nm]\n"])
def test_a_title_too_few_is_refused_where_rows_are_not_numbered(tmp_path: Path, titles: str) -> None:
    first = NUMBERED if titles.startswith("Nr") else [f"{k}.5" for k in NUMBERED]
    assert refused(tmp_path, titles + rows(first, P, N, M), "must have 3 cells, got 4") is None


@pytest.mark.parametrize("units", ["", "bar;1/min;Nm\n"])
def test_numbers_of_columns_are_none_of_the_rows(tmp_path: Path, units: str) -> None:
    (tmp_path / "a.csv").write_text((TITLES if not units else "p;n;M\n" + units) + "1;2;3\n" + rows(P, N, M))
    read = read_file(tmp_path / "a.csv", filename="a.csv")
    assert read.columns["torque_nm"].tolist() == M
    assert any("1 line above the first row" in notice.message for notice in read.notices)


def test_a_list_of_channels_above_names_the_columns(tmp_path: Path) -> None:
    """As loggers write it."""
    text = "CH,Signal,Range,Unit\nCH1,Pressure,10V,bar\nCH2,Speed,10V,rpm\nCH3,Torque,5V,Nm\n\nNo,CH1,CH2,CH3\n"
    (tmp_path / "a.csv").write_text(text + rows(NUMBERED, P, N, M, separator=","))
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["speed_rpm"].tolist() == N


LOGGED = [f"2026/11/03 23:59:{57 + k // 2}" if k < 6 else f"2026/11/04 00:00:0{k // 2 - 3}" for k in range(12)]
RECORDERS = {
    "a list of channels, and units among titles": (
        "CH1,Pressure,DC,10V,bar\nCH2,Speed,DC,10V,rpm\nCH3,Torque,DC,5V,Nm\nNumber,Date&Time,ms,CH1,CH2,CH3\n"
        "NO.,Time,ms,bar,rpm,Nm\n"
    ),
    "names above units, titles among the units": "Tag,,,Pressure,Speed,Torque\nNo,Date,ms,bar,rpm,Nm\n",
}


@pytest.mark.parametrize("titles", RECORDERS.values(), ids=RECORDERS)
def test_titles_and_units_in_one_row_are_told_apart(tmp_path: Path, titles: str) -> None:
    """As loggers of Graphtec and Yokogawa write them: the number of a row is no millisecond."""
    (tmp_path / "a.csv").write_text(titles + rows(NUMBERED, LOGGED, [0, 500] * 6, P, N, M, separator=","))
    columns = read_file(tmp_path / "a.csv", filename="a.csv").columns
    assert [columns[name].tolist() for name in STACKED] == [P, N, M]
    assert columns["time_s"].tolist() == [k / 2 for k in range(12)]


@pytest.mark.parametrize("cell", ["{:.1f}s", "{:.1f}", "2026-11-03 09:12:{:04.1f}"])
def test_times_without_a_title_are_suggested_by_their_number(tmp_path: Path, cell: str) -> None:
    """As PicoLog and pandas write them."""
    (tmp_path / "a.csv").write_text(";" + TITLES + rows([cell.format(k / 2) for k in range(12)], P, N, M))
    expected = STACKED | {"time_s": np.arange(12) / 2}
    assert same(tmp_path / "a.csv", expected, "dynamic_stribeck").map["time_s"].startswith("column 1")


def test_an_empty_column_of_times_is_none_of_a_profile(tmp_path: Path) -> None:
    """As LabVIEW writes it where it has no clock."""
    (tmp_path / "a.lvm").write_text(
        "X_Value\tp1 [bar]\tn1 [1/min]\tMz [Nm]\n" + rows([""] * 12, P, N, M, separator="\t")
    )
    profile = same(tmp_path / "a.lvm").profile
    assert profile is not None
    assert {column.title for column in profile.columns} == {"p1", "n1", "Mz"}


@pytest.mark.parametrize("step", [0.5, 1])
def test_an_index_of_pandas_is_asked_about_unless_it_counts_the_rows(tmp_path: Path, step: float) -> None:
    frame = pd.DataFrame(STACKED, index=np.arange(12) * step)
    frame.to_parquet(tmp_path / "a.parquet")
    frame.to_excel(tmp_path / "a.xlsx")
    for path in (tmp_path / "a.parquet", tmp_path / "a.xlsx"):
        if step == 1:
            assert read_file(path, filename=path.name).columns["torque_nm"].tolist() == M
        else:
            same(path, STACKED | {"time_s": frame.index.to_numpy()}, "dynamic_stribeck")


def test_a_title_of_numbers_that_is_a_sharp_begins_no_comment(tmp_path: Path) -> None:
    (tmp_path / "a.tsv").write_text("#\tp (bar)\tn (rpm)\tM (Nm)\n" + rows(NUMBERED, P, N, M, separator="\t"))
    assert read_file(tmp_path / "a.tsv", filename="a.tsv").columns["torque_nm"].tolist() == M


def test_units_may_stand_above_titles_beside_their_label(tmp_path: Path) -> None:
    """As TwinCAT's scope writes them, with a time before each channel."""
    text = "Unit\tbar\tUnit\trpm\tUnit\tNm\nTime [ms]\tfPressure\tTime [ms]\tfSpeed\tTime [ms]\tfTorque\n"
    times = [10 * k for k in range(12)]
    (tmp_path / "a.csv").write_text(text + rows(times, P, times, N, times, M, separator="\t"))
    suggestion = suggested(tmp_path / "a.csv", "dynamic_stribeck")
    assert [suggestion.map[name] for name in STACKED] == ["fPressure", "fSpeed", "fTorque"]


def test_of_several_times_in_a_long_table_those_that_stand_are_none(tmp_path: Path) -> None:
    """As InfluxDB writes the range that was asked for beside each time."""
    lines = ["_start,_time,_value,_field"]
    for name, values in zip(("pressure_bar", "speed_rpm", "torque_nm"), (P, N, M), strict=True):
        lines += [f"2026-03-12T00:00:00Z,2026-03-12T07:00:{k:02}Z,{value},{name}" for k, value in enumerate(values)]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    columns = read_file(tmp_path / "a.csv", filename="a.csv").columns
    assert columns["time_s"].tolist() == list(range(12))
    assert columns["torque_nm"].tolist() == M


def test_of_several_times_in_a_long_table_that_go_on_none_is_chosen(tmp_path: Path) -> None:
    """A clock of whole seconds stands for as many rows as are looked at first."""
    lines = ["time_s,timestamp,value,field"]
    for k in range(60):
        lines += [f"{k / 20},2026-03-12T07:00:{k // 20:02}Z,{20 + k % 7},torque_nm"]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(InvalidError, match="time_s must be one column"):
        read_file(tmp_path / "a.csv", filename="a.csv")


def test_a_point_in_cells_that_commas_separate_is_the_decimal_sign(tmp_path: Path) -> None:
    text = TITLES.replace(";", ",") + rows(P, [f"{n / 1000:.3f}" for n in N], M, separator=",")
    (tmp_path / "a.csv").write_text(text.replace("1/min", "krpm"))
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["speed_rpm"].tolist() == pytest.approx(N)


STATISTICS = {
    "mean": np.mean, "s": lambda column: np.std(column, ddof=1), "min": np.min, "max": np.max, "n": len,
}  # fmt: skip


@pytest.mark.parametrize("chosen", [["mean", "s", "min", "max", "n"], ["mean", "s", "n"]])
@pytest.mark.parametrize("label", ["", "first", "last"])
def test_statistics_below_a_table_are_left_out(tmp_path: Path, chosen: list[str], label: str) -> None:
    numbers = [str(k + 1) for k in range(12)]
    text = {"": TITLES, "first": "Nr;" + TITLES, "last": TITLES.replace("\n", ";Remark\n")}[label]
    text += rows(*([numbers] if label == "first" else []), P, N, M, *([["ok"] * 12] if label == "last" else []))
    for name in chosen:
        cells = [f"{STATISTICS[name](column):.3f}" for column in (P, N, M)]
        text += ";".join([name] * (label == "first") + cells + [name] * (label == "last")) + "\n"
    (tmp_path / "a.csv").write_text(text)
    read = read_file(tmp_path / "a.csv", filename="a.csv")
    assert read.columns["torque_nm"].tolist() == M
    assert any(f"left out: {len(chosen)}" in notice.message for notice in read.notices)


@pytest.mark.parametrize("named", [True, False])
def test_means_below_each_level_are_left_out(tmp_path: Path, named: bool) -> None:
    speeds = [*SPEEDS, 2400.0]
    text, kept = ("Nr;" if named else "") + TITLES, []
    for p, m in TORQUES.items():
        torques = [*m, m[-1] + 0.3]
        text += rows(*([[1, 2, 3, 4, 5]] if named else []), [p] * 5, speeds, torques)
        text += (f"Mittel {p:g} bar;" if named else "") + f"{p};{np.mean(speeds):.3f};{np.mean(torques):.3f}\n"
        kept += torques
    (tmp_path / "a.csv").write_text(text)
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["torque_nm"].tolist() == kept


MARKED_UP = {
    "HTML": (
        "<html><body><table><tr><td>Prüfer</td></tr></table><table>", "<tr>",
        "<td align=right>", "</td>", "</tr>", "</table></body></html>",
    ),
    "XML": (
        '<?xml version="1.0"?><Workbook xmlns:ss="x"><Worksheet ss:Name="a"><Table>', "<Row>",
        '<Cell><Data ss:Type="Number">', "</Data></Cell>", "</Row>", "</Table></Worksheet></Workbook>",
    ),
}  # fmt: skip


@pytest.mark.parametrize("parts", MARKED_UP.values(), ids=MARKED_UP)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252", "utf-16"])
def test_tables_in_html_and_xml_are_read(tmp_path: Path, parts: tuple[str, ...], encoding: str) -> None:
    start, row, cell, end_cell, end_row, end = parts
    lines = [TITLES.strip().split(";"), *zip(map(str, P), map(str, N), map(str, M), strict=True)]
    text = start + "".join(row + "".join(f"{cell}{own}{end_cell}" for own in line) + end_row for line in lines) + end
    (tmp_path / "a.xls").write_bytes(text.encode(encoding))
    assert read_file(tmp_path / "a.xls", filename="a.xls").columns["torque_nm"].tolist() == M


def test_cells_of_xml_stand_where_their_index_says(tmp_path: Path) -> None:
    cells = ['<Cell ss:Index="2">', '<Cell ss:Index="4">', "<Cell>"]
    row = "<Row>" + "".join(f"{cell}<Data>{{}}</Data></Cell>" for cell in cells) + "</Row>"
    lines = [TITLES.strip().split(";"), *zip(P, N, M, strict=True)]
    text = (
        "<?xml version='1.0'?><Workbook><Table>" + "".join(row.format(*line) for line in lines) + "</Table></Workbook>"
    )
    (tmp_path / "a.xls").write_text(text)
    assert read_file(tmp_path / "a.xls", filename="a.xls").columns["speed_rpm"].tolist() == N


def test_digits_of_full_width_are_digits(tmp_path: Path) -> None:
    wide = rows(P, N, M).translate(str.maketrans("0123456789.", "０１２３４５６７８９．"))
    (tmp_path / "a.csv").write_text(TITLES + wide, encoding="utf-8")
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["torque_nm"].tolist() == M


def test_a_comment_within_a_table_is_none_of_its_rows(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        TITLES + rows(P[:4], N[:4], M[:4]) + "# oil topped up at 12\n" + rows(P[4:], N[4:], M[4:])
    )
    assert read_file(tmp_path / "a.csv", filename="a.csv").columns["torque_nm"].tolist() == M
