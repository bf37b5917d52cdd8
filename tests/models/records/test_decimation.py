"""Fewer samples for a plot: no peak of any channel is lost, each row is a sample, and there are no more than asked for."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.arrays import FloatArray
from models.records.decimation import extreme_rows


def plainly(columns: list[list[float]], points: int) -> list[int]:
    """The same by loops over bins and samples."""
    samples, count = len(columns[0]), len(columns)
    bins = max(1, (points - 2) // (2 * count))
    length = -(-samples // bins)
    kept = {0, samples - 1}
    for start in range(0, samples, length):
        rows = range(start, min(samples, start + length))
        for column in columns:
            kept |= {min(rows, key=lambda row: column[row]), max(rows, key=lambda row: column[row])}
    return sorted(kept)


@given(
    samples=st.integers(1, 200),
    count=st.integers(1, 4),
    points=st.integers(1, 120),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_rows_are_those_that_loops_over_bins_find(samples: int, count: int, points: int, seed: int) -> None:
    columns = np.random.default_rng(seed).integers(-5, 5, (count, samples)).astype(float)
    rows = extreme_rows(columns, count, samples=samples, points=points)
    assert rows.tolist() == plainly(columns.tolist(), points)
    assert rows.size <= max(points, 2 * count + 2)


@pytest.mark.parametrize("points", [50, 500, 2000])
def test_one_sample_that_stands_out_is_never_lost(points: int) -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        columns = rng.standard_normal((3, 20_001))
        channel, row = rng.integers(3), rng.integers(20_001)
        columns[channel, row] = rng.choice([-40.0, 40.0])
        kept = extreme_rows(columns, 3, samples=20_001, points=points)
        assert row in kept
        assert {0, 20_000} <= set(kept)


def test_columns_are_gone_through_once() -> None:
    """As a generator gives them: one column is held at a time."""
    given_out = []

    def columns() -> Iterator[FloatArray]:
        for number in range(3):
            given_out.append(number)
            yield np.full(1000, float(number))

    assert extreme_rows(columns(), 3, samples=1000, points=20).tolist() == [0, 334, 668, 999]
    assert given_out == [0, 1, 2]
