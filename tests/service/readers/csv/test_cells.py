"""Cells picked out of blocks of CSV, against Python's own reader of CSV."""

import csv
import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.readers.csv.cells import picked, without_comments

CELL = st.text('ab1.,;"# ', max_size=5)
PLAIN = st.text("0123456789.,-", min_size=1, max_size=6)


def _written(rows: list[list[str]], separator: str, quoting: int) -> str:
    file = io.StringIO()
    csv.writer(file, delimiter=separator, quoting=quoting, lineterminator="\n").writerows(rows)  # type: ignore[arg-type]
    return file.getvalue()


@given(
    st.lists(st.tuples(CELL, PLAIN, CELL, PLAIN), min_size=1, max_size=6),
    st.sampled_from(",;\t"),
    st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_ALL, csv.QUOTE_NONNUMERIC]),
)
def test_what_a_writer_of_csv_writes_is_picked(rows: list[tuple[str, ...]], separator: str, quoting: int) -> None:
    """Words with quotes, separators and marks of comments in them stand beside the cells that are taken."""
    text = _written([list(row) for row in rows], separator, quoting)
    expected = "".join(f"{row[1]};{row[3]}\n" for row in rows)
    assert picked(text.encode(), separator.encode(), 4, [1, 3]) == expected.encode()


@settings(max_examples=500)
@given(st.lists(st.text('12;"', max_size=9), min_size=1, max_size=4), st.sampled_from([[0], [1], [0, 2], [0, 1, 2]]))
def test_nothing_is_picked_that_a_reader_of_csv_reads_otherwise(lines: list[str], taken: list[int]) -> None:
    got = picked("".join(line + "\n" for line in lines).encode(), b";", 3, taken)
    rows = list(csv.reader(lines, delimiter=";"))
    if got is not None:
        assert len(rows) == len(lines), "no cell goes over the end of a line"
        assert all(len(row) == 3 for row in rows)
        assert got.decode() == "".join(";".join(row[k] for k in taken) + "\n" for row in rows)


@pytest.mark.parametrize(
    ("text", "separator", "left", "skipped"),
    [
        ("1;2\n# a\n\n3;4\n", ";", "1;2\n3;4\n", [1, 1]),
        ('"# a"\n1,2\n   \n;b\n3,4\n%c\n', ",", "1,2\n3,4\n", [0, 1, 1, 2]),
        (";2\n;4\n", ";", ";2\n;4\n", []),
        ("/1;2\n// x\n", ";", "/1;2\n", [1]),
        ("#\n", ";", "", [0]),
    ],
)
def test_comments_and_blank_lines_are_left_out(text: str, separator: str, left: str, skipped: list[int]) -> None:
    assert without_comments(text.encode(), separator) == (left.encode(), skipped)
