"""CSV files of every make -> the same columns; files that are wrong -> errors that name the place."""

import contextlib
import gzip
import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.arrays import FloatArray
from service.errors import InvalidError, ServiceError, TooLargeError
from service.readers import column_names, unit_table
from service.readers.assemble import to_channels
from service.readers.column_names import column_of, known_channel
from service.readers.limits import LIMITS, LONGEST_TITLE
from service.readers.numerals import NUMBER
from service.readers.read_file import read_file
from service.readers.table import Reading
from service.readers.text import read_text
from tests.growth import APART, LINEAR, peak, time_ratio
from tests.service.readers.sample_files import csv_text, read_content, record

HEADER = "time_s,pressure_bar,speed_rpm,torque_nm"
ROWS = "0,5,100,20\n0.1,5,101,21\n"


def read(path: Path, content: str | bytes, mapping: str | None = None, name: str = "a.csv") -> dict[str, FloatArray]:
    return read_content(path, content, mapping, name=name).columns


def refused(path: Path, content: str | bytes, mapping: str | None = None) -> InvalidError:
    with pytest.raises(InvalidError) as caught:
        read_content(path, content, mapping)
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
        f"# made by a bench\n% 2026\n// x\n; y\n\n{HEADER}\n\n{ROWS}",
        '"time_s" , "pressure_bar" , "speed_rpm" , "torque_nm"\n"0","5","100","20"\n"0.1","5","101","21"\n',
        f"{HEADER}\n0 , 5, 100,20\n# a pause\n\n 0.1,5 ,101, 21\n",
        "time_ms\tpressure_kPa\tspeed_rpm\tTorque Nm\n0\t500\t100\t20\n100\t500\t101\t21\n",
        f"time_s,pressure_bar,speed_rpm,torque\r[s],[bar],[rpm],[Nm]\n{ROWS}",
        f"{HEADER}\n0e0,+5.,1E2,2.0e+1\n1e-1,.5e1,101,2100e-2\n",
    ],
)
def test_what_rigs_write(tmp_path: Path, text: str) -> None:
    got = read(tmp_path, text)
    assert list(got) == HEADER.split(",")
    expected = [[0, 0.1], [5, 5], [100, 101], [20, 21]]
    np.testing.assert_allclose(list(got.values()), expected, rtol=4e-16)  # one rounding in the conversion


WRONG = [
    ("", "must not be empty"),
    ("\n\n", "send a file with a header"),
    (f"{HEADER}\n", "time_s must not be empty"),
    (f"{HEADER}\n{ROWS}end of data\n0.2,5,100,20\n", r"line 4 must have 4 cells, got 1: 'end of data'"),
    (f"{HEADER}\n{ROWS}0.2,5,100\n", r"line 4 must have 4 cells, got 3"),
    (f"{HEADER}\n{ROWS}0.2,5,100,20,9\n", r"line 4 must have 4 cells, got 5"),
    (f"{HEADER}\n{ROWS}0.2,5,,20\n", r"speed_rpm\[2\] \(line 4\) must be a number, got ''"),
    (f"{HEADER}\n{ROWS}#\n\n0.2,5,x,20\n", r"speed_rpm\[2\] \(line 6\) must be a number, got 'x'"),
    (f"{HEADER}\n{ROWS}#\n0.2,5,NaN,20\n", r"speed_rpm\[2\] \(line 5\) must be finite, got nan"),
    (f"{HEADER}\n{ROWS}0.2,-9,100,20\n", r"pressure_bar\[2\] \(line 4\) must lie between .* got -9"),
    (f"{HEADER}\n{ROWS}0.2,5,0x10,20\n", "'0x10'"),
    (f"{HEADER}\n{ROWS}0.2,5,1\x000,20\n", r"line 4 has zero bytes \(1 in a row\), .*; the 3 lines before it are text"),
    (
        "time_s;torque_nm\n0,5;1,5\n1.5;2\n",
        r"time_s\[1\] \(line 3\) must have the decimal sign ',', as earlier numbers have, got '1.5'",
    ),
    ("time_s,time_s,torque_nm\n0,0,1\n1,9,1\n2,18,1\n", "time_s must be one column"),
    ("time_s,Drehmoment\n0,1\n", r"torque_nm \(column 'Drehmoment'\): the unit must be stated"),
    ("time_s,Drehmoment [furlong]\n0,1\n", "torque_nm .*the unit must be one of Nm.*'furlong'"),
    ("time_s,torque_nm\ns,kNm\n0,1\n", "torque_nm: the unit must be Nm, as the title says, got 'kNm'"),
    ("t [s],M [Nm]\ns,kNm\n0,1\n", "must be in one unit, got 'Nm' and 'kNm'"),
    (",".join(["torque_nm"] * 2_000_000) + "\n", "line 1 must not be longer than 65536 bytes"),
    (",".join("a" * 2000) + "\n" + ",".join("1" * 2000) + "\n", "more than 1000 columns, got 2000"),
    (f"{HEADER}\n" + "1" * 100_000 + "\n", "line 2 must have 4 cells, got 1"),
    (b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 40, "PNG picture"),
    (bytes(range(256)) * 400, "got binary data of a format that is not read here"),
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

    def unpack() -> None:
        with pytest.raises(TooLargeError, match="must not unpack to more than"):
            read(tmp_path, packed.getvalue(), name="run.csv.gz")

    assert peak(unpack) < 60e6


@pytest.mark.parametrize(
    ("limit", "error", "message"),
    [
        ({"most_values": 5000}, TooLargeError, "must not have more than 1000 rows"),
        ({"seconds": 0}, InvalidError, "more than 0 s"),
    ],
)
def test_rows_and_time_are_limited(
    tmp_path: Path, limit: dict[str, int], error: type[ServiceError], message: str
) -> None:
    (tmp_path / "posted").write_text(csv_text(record(30_000)), encoding="utf-8")
    with pytest.raises(error, match=message) as caught:
        read_file(tmp_path / "posted", filename="run.csv", limits=replace(LIMITS, **limit))
    assert error is TooLargeError or caught.value.errors[0].code == "too_slow"


def test_memory_is_the_columns_and_little_more(tmp_path: Path) -> None:
    columns = record(200_000)
    file = tmp_path / "run.csv"
    file.write_text(csv_text(columns), encoding="utf-8")
    # Columns grow by a third; a block and its arrays take less than 4 MB.
    assert peak(lambda: read_file(file, filename="run.csv")) < 4 / 3 * 1.05 * 200_000 * 5 * 8 + 6e6


@settings(deadline=None)
@given(st.binary(max_size=400))
def test_no_bytes_raise_anything_else(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    for body in (content, HEADER.encode() + b"\n" + content, b"\xff\xfe" + content, b"\x1f\x8b" + content):
        try:
            read(tmp_path_factory.getbasetemp(), body)
        except ServiceError as error:
            assert error.status in (413, 422)  # noqa: PT017


def untidy(columns: dict[str, FloatArray]) -> dict[str, tuple[str, str | None]]:
    """The same columns as no reader of plain numbers takes them, each with the map that it needs."""
    rows = [
        [repr(value) for value in row] for row in zip(*(column.tolist() for column in columns.values()), strict=True)
    ]
    head, needed = ",".join(columns), ",".join(f"{name}:{name}" for name in columns)
    german = [";".join(row).replace(".", ",") for row in rows]
    quoted = [",".join(f'"{cell}"' for cell in row).replace(".", ",") for row in rows]
    return {
        "decimal commas in quotes": (head + "\n" + "\n".join(quoted), None),
        "quotes here and there": (head + "\n" + "\n".join(f'"{row[0]}",' + ",".join(row[1:]) for row in rows), None),
        "comments": (head + "\n" + "\n".join(",".join(row) + "\n# ok\n" for row in rows), None),
        "a column of words": ("when," + head + "\n" + "\n".join("8:00," + ",".join(row) for row in rows), needed),
        "and decimal commas": (
            f"Datum;{head.replace(',', ';')}\n" + "\n".join("2.11.;" + row for row in german),
            needed,
        ),
    }


@pytest.mark.parametrize("kind", sorted(untidy(record(1))))
def test_untidy_files_are_the_same_columns(tmp_path: Path, kind: str) -> None:
    columns = record(4_000)
    text, needed = untidy(columns)[kind]
    same(read(tmp_path, text + "\n", needed), columns)


# --- CSV made to be costly: titles, units and cells of any length are read or refused in linear work and little memory.

#: Accents in an order that has to be sorted.
ACCENTS = "\u0301\u0316"


def channels(text: str) -> dict[str, FloatArray]:
    """What is read without a file, whose blocks would have memory of their own."""
    table = read_text(lambda: contextlib.nullcontext(io.BytesIO(text.encode())), Reading(), LIMITS)
    return to_channels(table, Reading(), LIMITS).columns


def outcome(text: str) -> str:
    """The error's code, or the channels that were read."""
    try:
        columns = channels(text)
    except ServiceError as error:
        return error.errors[0].code if error.errors else error.slug
    return ",".join(columns)


HEAD = "time_s,torque_nm\n"
FILES: dict[str, tuple[Callable[[int], str], str]] = {
    "one title of words": (lambda n: "a " * n + "\n1\n", "title_too_long"),
    "one title of units": (lambda n: "torque " + "Nm_" * n + "\n1\n", "title_too_long"),
    "one title of accents": (lambda n: "a" + ACCENTS * (n // 2) + "\n1\n", "title_too_long"),
    "titles of words": (lambda n: ",".join(["a " * 450] * (n // 450)) + "\n1\n", "invalid-content"),
    "titles of accents": (lambda n: ",".join(["a" + ACCENTS * 450] * (n // 900)) + "\n1\n", "invalid-content"),
    "a unit of letters": (lambda n: HEAD + "s," + "N" * n + "\n1,2\n", "unknown_unit"),
    "a unit of accents": (lambda n: f"time_s,torque\ns,N{ACCENTS * (n // 2)}\n1,2\n", "unknown_unit"),
    "digits and a letter": (lambda n: HEAD + "1," + "1" * n + "x\n", "not_a_number"),
    "digits and points": (lambda n: HEAD + "1," + "1." * (n // 2) + "x\n", "not_a_number"),
    "many digits": (lambda n: HEAD + "1," + "1" * n + "\n", "not_finite"),
    "columns": (lambda n: "a," * (n // 2) + "a\n" + "1," * (n // 2) + "1\n", "too_wide"),
    "empty cells": (lambda n: HEAD + "1,2" + "," * n + "\n", "time_s,torque_nm"),
    "blanks": (lambda n: HEAD + "1," + " " * n + "2\n", "time_s,torque_nm"),
    "quotation marks": (lambda n: HEAD + '"' * n + "\n", "no_header"),
}


#: One of a kind of cost; the others, of which one takes ten times as long, are tried by `make slow`.
QUICK = {"one title of words", "a unit of accents", "digits and a letter", "empty cells", "quotation marks"}


@pytest.mark.parametrize(
    "kind", [kind if kind in QUICK else pytest.param(kind, marks=pytest.mark.slow) for kind in FILES]
)
def test_work_and_memory_are_linear(kind: str) -> None:
    make, expected = FILES[kind]
    sizes = (2_500, APART * 2_500)
    files = {size: make(size) for size in sizes}
    assert [outcome(files[size]) for size in sizes] == [expected, expected]
    assert time_ratio(lambda size: outcome(files[size]), sizes[0], repeats=3) < LINEAR
    assert peak(lambda: outcome(files[sizes[1]])) < 20 * sizes[1] + 6 * 2**20  # blocks of a file have their own memory


def test_a_line_that_never_ends_is_given_up_early() -> None:
    for size in (200_000, 4_000_000):
        text = HEAD + "1" * size
        assert outcome(text) == "line_too_long"
        assert peak(lambda text=text: outcome(text)) < 2 * len(text) + 4 * 2**20  # type: ignore[misc]
    assert outcome("a," * 100_000) == "line_too_long"


@pytest.mark.slow
def test_two_million_wrong_cells_are_refused_block_by_block() -> None:
    """The errors of the first block that has any, not those of the file."""
    text = HEAD + "1,x\n" * 500_000
    assert peak(lambda: outcome(text)) < len(text) + 11 * 2**20  # blocks are half a MiB
    with pytest.raises(InvalidError, match=r"; \d+ errors up to line \d+") as raised:
        channels(text)
    assert len(raised.value.errors) == 50
    assert 50 < raised.value.total < 50_000


def test_the_longest_title_that_is_read_and_the_first_that_is_not() -> None:
    assert column_of("x" * LONGEST_TITLE).name == "x" * LONGEST_TITLE
    with pytest.raises(InvalidError, match="must not be longer than 1000 characters, got 1001: 'xxx"):
        column_of("x" * (LONGEST_TITLE + 1))


def test_what_is_known_is_far_below_the_bounds() -> None:
    """Names with blanks about them and between their words, units with blanks in them."""
    for channel in column_names.CHANNELS:
        assert known_channel(f"  {channel.replace('_', '   ')} ") == channel
    for channel, channels in ((c, unit_table.UNITS[column_names.CHANNELS[c].unit]) for c in column_names.CHANNELS):
        for unit in channels:
            assert unit_table.conversion(channel, f"   {unit}   ") == channels[unit]
    found = column_of("Anpressdruck der Kupplung am Kolben, gemessen im Zulauf [bar]")
    assert found.unit == "bar"
    assert column_of("pressure " + 20 * " " + " N/mm2").unit == "N/mm2"


@pytest.mark.parametrize(
    ("text", "number"),
    [("1", 1), ("+1.", 1), (".5e3", 1), ("1e-4000", 1), ("NaN", 1), ("-Infinity", 1)]
    + [(wrong, 0) for wrong in ("", ".", "1.5.", "1e", "1e12345", "0x1", "1_0", "١", "in", "1 2", "--1", "1.e", "e5")],
)
def test_a_number_is_what_it_was(text: str, number: int) -> None:
    assert (NUMBER.fullmatch(text) is not None) == bool(number)


def test_a_title_is_taken_apart_in_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step reads the whole title: there are no more of them for a long one."""
    steps = []
    ours = column_names.meaning
    monkeypatch.setattr(column_names, "meaning", lambda *name: steps.append(name) or ours(*name))
    counts = []
    for words in (50, 100, 250, 499):
        steps.clear()
        column_of("a " * words)
        counts.append(len(steps))
    assert counts[0] == counts[-1] < 30
