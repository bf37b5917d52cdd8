"""CSV made to be costly: titles, units and cells of any length are read or refused in linear work and little memory."""

import contextlib
import io
from collections.abc import Callable

import pytest

from models.arrays import FloatArray
from service.errors import InvalidError, ServiceError
from service.readers import column_names, unit_table
from service.readers.channels import to_channels
from service.readers.column_names import column_of, known_channel
from service.readers.limits import LIMITS, LONGEST_TITLE
from service.readers.numerals import NUMBER
from service.readers.read_file import reading_of
from service.readers.text import read_text
from tests.growth import LINEAR, peak, time_ratio

#: Accents in an order that has to be sorted.
ACCENTS = "\u0301\u0316"


def channels(text: str, mapping: str | None = None) -> dict[str, FloatArray]:
    reading = reading_of(mapping)
    table = read_text(lambda: contextlib.nullcontext(io.BytesIO(text.encode())), reading, LIMITS)
    return to_channels(table, reading, LIMITS).columns


def outcome(text: str, mapping: str | None = None) -> str:
    """The error's code, or the channels that were read."""
    try:
        columns = channels(text, mapping)
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
    sizes = (10_000, 40_000)
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
    assert peak(lambda: outcome(text)) < len(text) + 10 * 2**20
    with pytest.raises(InvalidError, match=r"; \d+ errors up to line \d+") as raised:
        channels(text)
    assert len(raised.value.errors) == 50
    assert 50 < raised.value.total < 50_000


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


def test_a_carriage_return_ends_a_line() -> None:
    text = "time_s,torque\r[s],[Nm]\n" + "".join(f"{n}.0,2\n" for n in range(3))
    assert outcome(text) == "time_s,torque_nm"
