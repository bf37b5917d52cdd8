"""Columns of decimals come back bit for bit, others are left alone, and damage is noticed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from storage.encoding import decode_decimals, encode, encode_decimals
from storage.engine.errors import DamagedData
from tests.storage.floats import same_bits


@given(
    st.integers(0, 15),
    st.integers(4096, 40_000),
    st.integers(0, 2**32),
    st.sampled_from([1.0, 1e3, 1e6, 1e9, 1e12, 1e17]),
)
@settings(deadline=None, max_examples=40)
def test_decimals_come_back_bit_for_bit_or_are_left_alone(decimals: int, length: int, seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    column = np.rint(np.cumsum(rng.standard_normal(length)) * size) / 10.0**decimals
    stored = encode_decimals(column)
    if size <= 1e6:
        assert stored is not None
        assert len(stored) < len(encode(column)) + 64
    if stored is not None:
        assert same_bits(decode_decimals(stored, length), column)


@pytest.mark.parametrize("other", [float("nan"), float("inf"), 0.1 + 1.4e-17, 5e-324, 1e300, 1 / 3, -1e12])
def test_one_value_that_is_no_decimal_or_steps_too_far_leaves_the_column_alone(other: float) -> None:
    """The double next to a decimal, what no float of 53 bits counts: none is changed by being stored."""
    column = np.round(np.arange(1, 100_001) / 1000, 3)
    column[[0, 50_000, -1]] = -0.0
    whole = encode_decimals(column)
    assert whole is not None
    assert same_bits(decode_decimals(whole, column.size), column)
    column[77_777] = other
    assert encode_decimals(column) is None


def test_noise_is_none_of_decimals() -> None:
    assert encode_decimals(np.random.default_rng(1).standard_normal(10_000)) is None


@given(st.integers(0, 60_000), st.integers(1, 255))
@settings(deadline=None, max_examples=30)
def test_damaged_decimals_are_noticed(place: int, change: int) -> None:
    stored = encode_decimals(np.round(np.random.default_rng(0).standard_normal(30_000), 2))
    assert stored is not None
    broken = bytearray(stored)
    broken[place % len(stored)] ^= change
    with pytest.raises(DamagedData):
        decode_decimals(broken, 30_000)
    with pytest.raises(DamagedData):
        decode_decimals(stored, 29_999)
    with pytest.raises(DamagedData):
        decode_decimals(stored[:20], 30_000)
