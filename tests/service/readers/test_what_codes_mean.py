"""Codes and marks that stand for something: qualities, infinities, what programs write where there is no number."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.errors import InvalidError
from tests.service.readers.sample_files import read_content

TITLES = "p [bar],n [1/min],M [Nm]"
ROWS = [f"{p},{n},{20 + p / 10 - n / 1000:.2f}" for p in (4, 5, 6) for n in (20, 120, 520, 1970)]


def marked(title: str, of_good: object, of_bad: object) -> str:
    """The rows with a column of codes; those at 5 bar are bad."""
    return "\n".join([f"{TITLES},{title}", *(f"{row},{of_bad if row[0] == '5' else of_good}" for row in ROWS)]) + "\n"


def pressures(folder: Path, text: str, **options: Any) -> list[float]:
    return np.unique(read_content(folder, text, **options).columns["pressure_bar"]).tolist()


@pytest.mark.parametrize(
    ("title", "of_good", "of_bad"),
    [
        ("Quality", "Good", "Bad"), ("Quality", "Good", "Uncertain"), ("Quality", 192, 0), ("Quality", 192, 64),
        ("StatusQuality", 0, 2**31), ("Quality", 0, 2158690304), ("valid", 1, 0), ("M gültig", "true", "false"),
        ("invalid", 0, 1), ("Status", "OK", "FAULT"),
    ],
)  # fmt: skip
def test_rows_are_left_out_by_words_by_codes_of_a_format_and_by_flags_whose_title_says_what_they_mean(
    tmp_path: Path, title: str, of_good: object, of_bad: object
) -> None:
    assert pressures(tmp_path, marked(title, of_good, of_bad)) == [4, 6]


@pytest.mark.parametrize(
    ("title", "of_good", "of_bad"),
    [("Quality", 0, 1), ("Quality", 1, 0), ("Datenqualität", "A", "B"), ("Quality", "true", "false"), ("Quality", "", "x"),
     ("Quality", 192, 300), ("Status", "OK", "sensor_fault"), ("Zustand", "ok", "Rampe"), ("Ausreißer", "", "x")],
)  # fmt: skip
def test_a_code_of_unknown_meaning_is_asked_for(tmp_path: Path, title: str, of_good: object, of_bad: object) -> None:
    text = marked(title, of_good, of_bad)
    with pytest.raises(InvalidError, match=r"which of them is good\? Add good=") as caught:
        pressures(tmp_path, text)
    assert caught.value.errors[0].code == "which_is_good"
    assert pressures(tmp_path, text, good=str(of_good).strip() or "empty") == [4, 6]
    assert pressures(tmp_path, text, good="none") == [4, 5, 6]


@pytest.mark.parametrize("title", ["Bemerkung", "Remark", "Status"])
def test_a_word_for_bad_rows_among_notes_is_asked_about(tmp_path: Path, title: str) -> None:
    notes = dict.fromkeys(range(12), "") | {3: "ungültig", 5: "Öl nachgefüllt", 7: "Sensor fault"}
    text = "\n".join([f"{TITLES},{title}", *(f"{row},{notes[at]}" for at, row in enumerate(ROWS))]) + "\n"
    with pytest.raises(InvalidError, match="Add good=empty,öl nachgefüllt, or") as caught:
        pressures(tmp_path, text)
    assert read_content(tmp_path, text, good=caught.value.errors[0].value).columns["torque_nm"].size == 10


@pytest.mark.parametrize("end", ["\n", ""])
def test_notes_may_be_missing(tmp_path: Path, end: str) -> None:
    """As LabVIEW leaves them, without a separator before them."""
    text = "\n".join([f"{TITLES},Comment", *ROWS[:-1], f"{ROWS[-1]},end of test"]) + end
    assert read_content(tmp_path, text).columns["torque_nm"].size == len(ROWS)


def test_notes_of_no_bad_row_leave_the_status_to_say_which_is_good(tmp_path: Path) -> None:
    text = marked("Status,Remark", "OK,", "sensor fault,oil topped up")
    assert pressures(tmp_path, text, good="ok") == [4, 6]


@pytest.mark.parametrize("code", [0, 1, 192, "n", "ON"])
@pytest.mark.parametrize("title", ["Quality", "Status", "Zustand"])
def test_one_code_in_all_rows_leaves_none_out(tmp_path: Path, title: str, code: object) -> None:
    assert pressures(tmp_path, marked(title, code, code)) == [4, 5, 6]


def test_states_of_a_machine_and_qualities_in_percent_are_no_codes(tmp_path: Path) -> None:
    assert pressures(tmp_path, marked("Status", 3, 7)) == [4, 5, 6]
    percent = "\n".join([f"{TITLES},Signal quality", *(f"{row},{90 + at}" for at, row in enumerate(ROWS))]) + "\n"
    assert pressures(tmp_path, percent) == [4, 5, 6]


@pytest.mark.parametrize("mark", ["inf", "-inf", "nan", "1.#QNAN", "-1.#IND", "1.#INF", "#DIV/0!", "#NV", "---"])
def test_a_mark_where_there_is_no_number_is_refused_with_a_remedy_that_works(tmp_path: Path, mark: str) -> None:
    lines = [*ROWS[:5], ROWS[5].rpartition(",")[0] + f",{mark}", *ROWS[6:]]
    text = "\n".join([TITLES, *lines]) + "\n"
    with pytest.raises(InvalidError) as caught:
        read_content(tmp_path, text)
    assert f"add missing={mark} to leave" in caught.value.detail
    read = read_content(tmp_path, text, missing=mark)
    expected = [float(row.rpartition(",")[2]) for row in ROWS[:5] + ROWS[6:]]
    assert read.columns["torque_nm"].tolist() == expected
    assert [notice.code for notice in read.notices] == ["invalid_samples"]


@pytest.mark.parametrize("values", [[np.inf] * 2, [np.inf, -np.inf], [np.nan, np.inf]])
def test_an_infinite_value_makes_no_row_a_total(tmp_path: Path, values: list[float]) -> None:
    """The last row has the highest pressure and speed, as a row of maxima would."""
    rows = [row.split(",") for row in ROWS]
    for row, value in zip(rows[2:], values, strict=False):
        row[2] = str(value)
    text = "\n".join([TITLES, *map(",".join, rows)]) + "\n"
    read = read_content(tmp_path, text, missing="inf,-inf,nan")
    assert read.columns["torque_nm"].size == len(ROWS) - len(values)
    assert read.columns["speed_rpm"][-1] == 1970


def test_means_below_rows_with_gaps_are_still_left_out(tmp_path: Path) -> None:
    rows = [row.split(",") for row in ROWS]
    rows[3][2] = "inf"
    columns = np.array(rows, dtype=float)
    means = [np.mean(column[np.isfinite(column)]) for column in columns.T]
    text = "\n".join([TITLES, *map(",".join, rows), ",".join(f"{mean:.6f}" for mean in means)]) + "\n"
    read = read_content(tmp_path, text, missing="inf")
    assert read.columns["torque_nm"].size == len(ROWS) - 1
    assert read.notices[0].message.startswith("left out: 1 row from line 14 on, the means")
