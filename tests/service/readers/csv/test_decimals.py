"""Decimals of whole blocks, against Python's `float`."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.readers.csv.decimals import NUMBER, parse_rows

CELLS = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(10**25), 10**25).map(str),
    st.decimals(-(10**9), 10**9, places=6).map(str),
    st.from_regex(r"\A[+-]?([0-9]{1,22}\.?[0-9]{0,22}|\.[0-9]{1,22})([eE][+-]?[0-9]{1,3})?\Z"),
)


@given(st.lists(st.tuples(CELLS, CELLS, CELLS), min_size=1, max_size=8))
def test_decimals_are_what_float_says(rows: list[tuple[str, str, str]]) -> None:
    text = "".join(";".join(row) + "\n" for row in rows).encode()
    got = parse_rows(text, ord(";"), 3)
    assert got is not None
    assert got.tobytes() == np.array([[float(cell) for cell in row] for row in rows]).tobytes()


@given(st.lists(st.text("0123456789.eE+-, \nxn_", min_size=1, max_size=9), min_size=1, max_size=6))
def test_decimals_take_nothing_that_is_no_number(parts: list[str]) -> None:
    text = ",".join(parts) + "\n"
    got = parse_rows(text.encode(), ord(","), 2)
    lines = [line.split(",") for line in text[:-1].split("\n")]
    good = all(len(line) == 2 and all(NUMBER.fullmatch(cell) for cell in line) for line in lines)
    assert good or got is None
    if got is not None:
        assert got.tobytes() == np.array([[float(cell) for cell in line] for line in lines]).tobytes()
