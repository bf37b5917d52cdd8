"""Plain numbers eight digits at a time: bit for bit what Python reads; anything else is left to others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.readers.plain_numbers import plain_columns

_CELL = st.from_regex(r"-?([0-9]{1,9}(\.[0-9]{0,9})?|\.[0-9]{1,9})", fullmatch=True)


@settings(max_examples=300, deadline=None)
@given(st.integers(1, 5), st.lists(_CELL, min_size=1, max_size=60))
def test_numbers_are_those_of_python_or_none_are_given(width: int, cells: list[str]) -> None:
    """A witness: `float`, which rounds to the nearest double."""
    rows = [cells[at : at + width] for at in range(0, len(cells) - width + 1, width)] or [cells[:1] * width]
    block = "".join(",".join(row) + "\n" for row in rows).encode()
    read = plain_columns(block, width, range(width))
    short = all(len(part) <= 8 for row in rows for cell in row for part in cell.lstrip("-").split("."))
    exact = all(len(cell.replace(".", "").lstrip("-")) < 16 for row in rows for cell in row)
    assert (read is not None) or not (short and exact)
    if read is not None:
        expected = np.array([[float(cell) for cell in row] for row in rows])
        for column, values in enumerate(read):
            assert values.tobytes() == expected[:, column].tobytes()


@pytest.mark.parametrize("decimals", range(9))
def test_columns_of_one_width_are_read_in_one_piece(decimals: int) -> None:
    values = np.random.default_rng(5).uniform(-99, 99, 500)
    cells = [f"{value:.{decimals}f}" for value in values]
    read = plain_columns("".join(f"{cell},7\n" for cell in cells).encode(), 2, [0])
    assert read is not None
    assert read[0].tolist() == [float(cell) for cell in cells]


@pytest.mark.parametrize(
    "block",
    [b"", b"1\n", b"1,2\n3\n", b"1,2,3\n", b",1\n", b"-,1\n", b".,1\n", b"1.2.3,1\n", b"1-2,1\n", b"1e3,1\n", b"nan,1\n",
     b"1,2\n\n", b"123456789,1\n", b"1.123456789,1\n", b"99999999.99999999,1\n", b"1 ,2\n"],
)  # fmt: skip
def test_what_is_not_plain_is_left_to_others(block: bytes) -> None:
    assert plain_columns(block, 2, [0, 1]) is None


def test_columns_that_are_not_taken_are_not_read() -> None:
    read = plain_columns(b"1,123456789,3\n", 3, [0, 2])
    assert read is not None
    assert [column.tolist() for column in read] == [[1.0], [3.0]]
