"""CSV files of every make -> the same columns; files that are wrong -> errors that name the place."""

import gzip
import io
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.arrays import FloatArray
from service.errors import InvalidError, ServiceError, TooLargeError
from service.readers.limits import LIMITS
from service.readers.read_file import read_file, reading_of
from tests.service.readers.sample_files import csv_text, record

HEADER = "time_s,pressure_bar,speed_rpm,torque_nm"
ROWS = "0,5,100,20\n0.1,5,101,21\n"


def read(path: Path, content: str | bytes, mapping: str | None = None, name: str = "run.csv") -> dict[str, FloatArray]:
    file = path / "posted"
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_file(file, filename=name, reading=reading_of(mapping)).columns


def refused(path: Path, content: str | bytes, mapping: str | None = None, name: str = "run.csv") -> InvalidError:
    with pytest.raises(InvalidError) as caught:
        read(path, content, mapping, name)
    return caught.value


def same(got: dict[str, FloatArray], expected: dict[str, FloatArray]) -> None:
    assert got.keys() == expected.keys()
    for name, column in expected.items():
        assert got[name].tobytes() == column.tobytes(), name


@pytest.mark.parametrize(
    ("separator", "decimal", "ending", "encoding"),
    [
        (",", ".", "\n", "utf-8"),
        (";", ",", "\r\n", "utf-8-sig"),
        ("\t", ",", "\n", "utf-16"),
        ("\t", ".", "\r\n", "utf-16-le"),
        (";", ".", "\r", "latin-1"),
        (",", ".", "\r\n", "utf-16-be"),
    ],
)
def test_every_make_gives_the_same_columns(
    tmp_path: Path, separator: str, decimal: str, ending: str, encoding: str
) -> None:
    columns = record(5000)
    text = csv_text(columns, separator=separator, decimal=decimal, ending=ending)
    same(read(tmp_path, text.encode(encoding)), columns)
    same(read(tmp_path, gzip.compress(text.encode(encoding)), name="run.csv.gz"), columns)


@pytest.mark.parametrize("number", ["%r", "%.9e", "%.12f", "%.17g"])
def test_numbers_are_read_as_python_reads_them(tmp_path: Path, number: str) -> None:
    columns = {name: column * (1 + 1e-9) for name, column in record(3000).items()}
    written = {name: np.array([float(number % value) for value in column.tolist()]) for name, column in columns.items()}
    same(read(tmp_path, csv_text(columns, number=number)), written)


@pytest.mark.parametrize(
    "text",
    [
        f"{HEADER}\n{ROWS}",
        f"# made by a bench\n% 2026\n// x\n; y\n\n{HEADER}\n\n{ROWS}",
        f"{HEADER}\ns,bar,rpm,Nm\n{ROWS}",
        f"{HEADER},,\n[s],[bar],[1/min],[N·m],,\n0,5,100,20,,\n0.1,5,101,21,,\n",
        "t [s];p / bar;n (1/min);Drehmoment in Nm\n0;5;100;20\n0,1;5;101;21\n",
        "sep=;\nZeit [ms];Druck [MPa];Drehzahl [U/min];M [kNm]\n0;0,5;100;0,02\n100;0,5;101;0,021\n",
        '"time_s" , "pressure_bar" , "speed_rpm" , "torque_nm"\n"0","5","100","20"\n"0.1","5","101","21"\n',
        'time_s,pressure_bar,speed_rpm,torque_nm\n"0","5","100","20"\n"0,1","5","101","21"\n',
        f"{HEADER}\n0 , 5, 100,20\n# a pause\n\n 0.1,5 ,101, 21",
        f"# {HEADER}\n{ROWS}",
        "time_ms\tpressure_kPa\tspeed_rpm\tTorque Nm\n0\t500\t100\t20\n100\t500\t101\t21\n",
        "time_s,pressure_bar,speed_rpm,torque_nm\n0e0,+5.,1E2,2.0e+1\n1e-1,.5e1,101,2100e-2\n",
    ],
)
def test_what_rigs_write(tmp_path: Path, text: str) -> None:
    got = read(tmp_path, text)
    expected: dict[str, list[float]] = {
        "time_s": [0, 0.1],
        "pressure_bar": [5, 5],
        "speed_rpm": [100, 101],
        "torque_nm": [20, 21],
    }
    assert got.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(got[name], values, rtol=4e-16)  # one rounding in the conversion


def test_a_map_names_columns_and_leaves_the_others_out(tmp_path: Path) -> None:
    text = "Mz;Strom [A];Druck 1 [bar];when\n20;1,5;5;8:00\n21;1,6;5;8:01\n"
    got = read(tmp_path, text, mapping="torque_nm:Mz,pressure_bar:Druck 1")
    assert {name: column.tolist() for name, column in got.items()} == {"torque_nm": [20, 21], "pressure_bar": [5, 5]}


WRONG = [
    ("", "must not be empty"),
    ("\n\n", "send a file with a header"),
    ("1,2,3,4\n5,6,7,8\n", "line 1 must be a header"),
    (f"{HEADER}\n", "time_s must not be empty"),
    (f"{HEADER}\n{ROWS}end of data\n0.2,5,100,20\n", r"line 4 must have 4 cells, got 1: 'end of data'"),
    (f"{HEADER}\n{ROWS}0.2,5,100\n", r"line 4 must have 4 cells, got 3"),
    (f"{HEADER}\n{ROWS}0.2,5,100,20,9\n", r"line 4 must have 4 cells, got 5"),
    (f"{HEADER}\n0.2,5,,20\n", r"speed_rpm\[0\] \(line 2\) must be a number, got ''"),
    (f"{HEADER}\n{ROWS}0.2,5,,20\n", r"speed_rpm\[2\] \(line 4\) must be a number, got ''"),
    (f"{HEADER}\n{ROWS}#\n\n0.2,5,x,20\n", r"speed_rpm\[2\] \(line 6\) must be a number, got 'x'"),
    (f"{HEADER}\n{ROWS}#\n0.2,5,NaN,20\n", r"speed_rpm\[2\] \(line 5\) must be finite, got nan"),
    (f"{HEADER}\n{ROWS}0.2,-9,100,20\n", r"pressure_bar\[2\] \(line 4\) must lie between .* got -9"),
    (f"{HEADER}\n{ROWS}0.2,5,0x10,20\n", "'0x10'"),
    (f"{HEADER}\n{ROWS}0.2,5,1_0,20\n", "'1_0'"),
    (f"{HEADER}\n{ROWS}0.2,5,1\x000,20\n", "line 4 has a NUL byte, which is no text"),
    (
        "time_s;torque_nm\n0,5;1,5\n1.5;2\n",
        r"time_s\[1\] \(line 3\) must have the decimal sign ',', as earlier numbers have, got '1.5'",
    ),
    ("time_s,time_s,torque_nm\n0,0,1\n1,9,1\n2,18,1\n", "time_s must be one column"),
    ("time_s,torque_nm,M [Nm]\n0,0,1\n", "torque_nm must be one column, got torque_nm and M"),
    ("time_s,Drehmoment\n0,1\n", r"torque_nm \(column 'Drehmoment'\): the unit must be stated"),
    ("time_s,Drehmoment [furlong]\n0,1\n", "torque_nm .*the unit must be one of Nm.*'furlong'"),
    ("time_s,n [mPa]\n0,1\n", "speed_rpm .*'mPa'"),
    ("time_s,torque_nm\ns,kNm\n0,1\n", "torque_nm: the unit must be Nm, as the title says, got 'kNm'"),
    ("t [s],M [Nm]\ns,kNm\n0,1\n", "must be in one unit, got 'Nm' and 'kNm'"),
    (",".join(["torque_nm"] * 2_000_000) + "\n", "line 1 must not be longer than 65536 bytes"),
    (",".join("a" * 2000) + "\n" + ",".join("1" * 2000) + "\n", "more than 1000 columns, got 2000"),
    (f"{HEADER}\n" + "1" * 100_000 + "\n", "line 2 must have 4 cells, got 1"),
    (b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 40, "PNG picture"),
    (bytes(range(256)) * 400, "NUL"),
    (b"PK\x03\x04" + bytes(100), "ZIP archive cannot be read"),
    (gzip.compress(HEADER.encode(), mtime=0)[:-6], "cannot be unpacked"),
    (gzip.compress(gzip.compress(HEADER.encode(), mtime=0), mtime=0), "twice with gzip"),
    ("\ufeff".encode("utf-16-le") + b"\x00\xd8" * 4000, "UTF-16"),
]


@pytest.mark.parametrize(("content", "message"), WRONG, ids=[message for _, message in WRONG])
def test_wrong_files_are_refused_with_their_place(tmp_path: Path, content: str | bytes, message: str) -> None:
    error = refused(tmp_path, content)
    messages = " ".join([error.detail, *(item.message for item in error.errors)])
    assert re.search(message, messages), messages
    assert len(error.errors) <= 50
    assert len(error.detail) < 2500


@pytest.mark.parametrize(
    "mapping", ["torque_nm", "Mz", "torque_nm:", "torque:Mz", "torque_nm:a,torque_nm:b", "torque_nm:no"]
)
def test_wrong_maps_are_refused(tmp_path: Path, mapping: str) -> None:
    assert "map" in refused(tmp_path, "a,b\n1,2\n", mapping).detail


def test_many_errors_are_counted_and_fifty_shown(tmp_path: Path) -> None:
    error = refused(tmp_path, f"{HEADER}\n" + "0,5,nan,20\n" * 30_000)
    assert error.total == 30_000
    assert len(error.errors) == 50
    assert error.errors[49].row == 50


def test_a_gzip_bomb_stops_at_the_cap(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with gzip.GzipFile(fileobj=packed, mode="wb") as file:
        file.write(HEADER.encode() + b"\n")
        for _ in range(40):
            file.write(b"0,5,100,20\n" * 100_000)
    tracemalloc.start()
    with pytest.raises(TooLargeError, match="must not unpack to more than"):
        read(tmp_path, packed.getvalue(), name="run.csv.gz")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6


def test_too_many_rows_are_too_large(tmp_path: Path) -> None:
    file = tmp_path / "run.csv"
    file.write_text(csv_text(record(2000)), encoding="utf-8")
    with pytest.raises(TooLargeError, match="must not have more than 1000 rows"):
        read_file(file, filename="run.csv", limits=replace(LIMITS, most_values=5000))


def test_memory_is_the_columns_and_little_more(tmp_path: Path) -> None:
    columns = record(200_000)
    file = tmp_path / "run.csv"
    file.write_text(csv_text(columns), encoding="utf-8")
    tracemalloc.start()
    read_file(file, filename="run.csv")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # Columns grow by a third; a block and its arrays take less than 4 MB.
    assert peak < 4 / 3 * 1.05 * 200_000 * 5 * 8 + 6e6


@settings(deadline=None)
@given(st.binary(max_size=400))
def test_no_bytes_raise_anything_else(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    for body in (content, HEADER.encode() + b"\n" + content, b"\xff\xfe" + content, b"\x1f\x8b" + content):
        file = tmp_path_factory.getbasetemp() / "any"
        file.write_bytes(body)
        try:
            read_file(file, filename="any.csv")
        except ServiceError as error:
            assert error.status in (413, 422)  # noqa: PT017


def untidy(columns: dict[str, FloatArray]) -> dict[str, tuple[str, str | None]]:
    """The same columns as no reader of plain numbers takes them, each with the map that it needs."""
    rows = [
        [repr(value) for value in row] for row in zip(*(column.tolist() for column in columns.values()), strict=True)
    ]
    head, needed = ",".join(columns), ",".join(f"{name}:{name}" for name in columns)
    german = [";".join(row).replace(".", ",") for row in rows]
    return {
        "decimal commas in quotes": (head + "\n" + "\n".join(_quoted(row) for row in rows), None),
        "quotes here and there": (head + "\n" + "\n".join(f'"{row[0]}",' + ",".join(row[1:]) for row in rows), None),
        "comments": (head + "\n" + "\n".join(",".join(row) + "\n# ok\n" for row in rows), None),
        "a column of words": ("when," + head + "\n" + "\n".join("8:00," + ",".join(row) for row in rows), needed),
        "and decimal commas": (
            f"Datum;{head.replace(',', ';')}\n" + "\n".join("2.11.;" + row for row in german),
            needed,
        ),
    }


def _quoted(row: list[str]) -> str:
    return ",".join(f'"{cell}"' for cell in row).replace(".", ",")


@pytest.mark.parametrize("kind", sorted(untidy(record(1))))
def test_untidy_files_are_the_same_columns(tmp_path: Path, kind: str) -> None:
    columns = record(4_000)
    text, needed = untidy(columns)[kind]
    same(read(tmp_path, text + "\n", needed), columns)


def test_one_column_of_many_words(tmp_path: Path) -> None:
    assert read(tmp_path, "a,M [Nm]\nx,1.5\ny,2.5\n", "torque_nm:M")["torque_nm"].tolist() == [1.5, 2.5]


def test_reading_has_its_time(tmp_path: Path) -> None:
    (tmp_path / "posted").write_text(csv_text(record(30_000)), encoding="utf-8")
    with pytest.raises(InvalidError, match="more than 0 s") as caught:
        read_file(tmp_path / "posted", filename="run.csv", limits=replace(LIMITS, seconds=0))
    assert caught.value.errors[0].code == "too_slow"
