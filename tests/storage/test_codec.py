"""Bit equality of stored columns and packed arrays, and that damage is noticed."""

import struct
import zlib
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from storage.encoding import CODEC, decode, decode_decimals, encode, encode_decimals, pack, unpack
from storage.engine.errors import DamagedData

AWKWARD = [0.0, -0.0, 5e-324, -2.2e-308, 1e308, -1.7976931348623157e308, float("inf"), float("-inf"), 0.1, 1 / 3]


def same_bits(left: NDArray[np.float64], right: NDArray[np.float64]) -> bool:
    return left.dtype == right.dtype == np.float64 and left.tobytes() == right.tobytes()


@given(
    hnp.arrays(np.uint64, st.integers(0, 400)).map(lambda pattern: pattern.view(np.float64))  # NaNs with any payload
    | hnp.arrays(np.float64, st.integers(0, 400), elements=st.floats(width=64) | st.sampled_from(AWKWARD))
)
def test_any_column_comes_back(column: NDArray[np.float64]) -> None:
    assert same_bits(decode(encode(column), CODEC, column.size), column)


def long_columns() -> Iterator[NDArray[np.float64]]:
    """Long enough for their deflater to be chosen by a probe, which looks at the middle: noise, steps, a clock, constants;
    quiet in the middle and noise at the ends, and the other way round."""
    rng = np.random.default_rng(1)
    for length in (1, 1 << 14, (1 << 14) + 1, 100_000):
        yield from (rng.standard_normal(length), np.round(rng.standard_normal(length), 3), np.full(length, 5.0))
    noise = np.round(20 + 0.25 * rng.standard_normal(100_000), 4)
    yield from (noise, np.repeat(noise[:1000], 100), np.round(np.arange(100_000) / 1000, 3))
    quiet_middle, quiet_ends = rng.standard_normal(200_000), np.ones(200_000)
    quiet_middle[80_000:120_000] = 1.0
    quiet_ends[80_000:120_000] = rng.standard_normal(40_000)
    yield from (quiet_middle, quiet_ends)


def test_long_columns_come_back_whatever_their_planes_are() -> None:
    for column in long_columns():
        assert same_bits(decode(encode(column), CODEC, column.size), column)


def test_what_is_read_may_be_written_to_and_strides_do_not_matter() -> None:
    column = np.arange(20.0)[::-2]
    back = decode(encode(column), CODEC, column.size)
    back[0] = -1.0
    assert same_bits(back[1:], column[1:])


def test_smooth_columns_shrink_noise_hardly_grows_and_flags_take_a_bit_each() -> None:
    time = np.round(np.arange(100_000) / 1000, 3)
    assert len(encode(time)) < time.nbytes / 20
    rounded = np.round(20 + 0.25 * np.random.default_rng(1).standard_normal(100_000), 4)
    assert len(encode(rounded)) < rounded.nbytes
    noise = np.random.default_rng(0).integers(0, 2**63, 10_000).view(np.float64)
    assert len(encode(noise)) <= noise.nbytes + 36
    assert len(pack({"flags": np.eye(64)})) < 64 * 64 / 8 + 50


@pytest.mark.parametrize(
    "column", [np.arange(3), np.zeros(3, ">f8"), np.zeros(3, np.float32), np.zeros((2, 2)), np.array(1.0)]
)
def test_only_a_row_of_64_bit_floats_is_taken(column: NDArray[np.float64]) -> None:
    with pytest.raises(ValueError, match="one row of float64"):
        encode(column)
    with pytest.raises(ValueError, match="weights must be of float64 or bool, got float32"):
        pack({"weights": np.zeros(3, np.float32)})


@pytest.mark.parametrize("length", [0, 49, 51, 1_000_000])
def test_another_length_is_noticed_and_another_codec_named(length: int) -> None:
    with pytest.raises(DamagedData):
        decode(encode(np.arange(50.0)), CODEC, length)
    with pytest.raises(DamagedData, match="zstd"):
        decode(b"", "zstd", 0)


def test_the_stored_bytes_are_little_endian_wherever_they_were_written() -> None:
    """A column of one value keeps its eight planes plain: the value's own bytes, least significant first."""
    assert encode(np.array([-1.5]))[-8:] == struct.pack("<d", -1.5)


SHAPES = hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5)
SMALL = np.round(np.random.default_rng(1).standard_normal(60), 2)


@pytest.mark.parametrize(
    ("stored", "read"),
    [
        (encode(SMALL), lambda stored: decode(stored, CODEC, SMALL.size)),
        (pack({"a": SMALL, "b": SMALL[:3]}), unpack),
    ],
    ids=["column", "arrays"],
)
def test_every_damaged_byte_and_every_cut_is_noticed(stored: bytes, read: Callable[[bytes], object]) -> None:
    read(bytes(stored))
    for position in range(len(stored)):
        damaged = bytearray(stored)
        damaged[position] ^= 0x10
        for wrong in (bytes(damaged), bytes(stored[:position])):
            with pytest.raises(DamagedData):
                read(wrong)


@given(
    st.dictionaries(
        st.text(max_size=8),
        hnp.arrays(np.uint64, SHAPES).map(lambda pattern: np.asarray(pattern.view(np.float64)))
        | hnp.arrays(np.float64, SHAPES, elements=st.sampled_from([0.0, 1.0, -0.0])),  # flags among them
        max_size=4,
    )
)
def test_packed_arrays_come_back(arrays: dict[str, NDArray[np.float64]]) -> None:
    back = unpack(pack(arrays))
    assert list(back) == list(arrays)
    assert all(back[name].shape == array.shape and same_bits(back[name], array) for name, array in arrays.items())


def test_states_of_earlier_releases_are_read() -> None:
    flags = np.eye(64)
    index = b'[["flags",[64,64]]]'
    plain = _sealed(struct.pack("<I", len(index)) + index + flags.tobytes())
    assert same_bits(unpack(plain)["flags"], flags)


def _sealed(body: bytes) -> bytes:
    return struct.pack("<I", zlib.crc32(body)) + body


@pytest.mark.parametrize(
    "index",
    [
        b"not json",
        b'[["a"]]',
        b'[["a", [9]]]',
        b'[["a", "x"]]',
        b'[["a", [-1]]]',
        b"7",
        b'[["a", [1]], ["b", [1]]]',
        b'[["a", [-96], "bits"]]',
        b'[["a", [90], "bits"], ["b", [1]]]',
        b'[["a", [12], "bytes"]]',
    ],
)
def test_an_index_that_does_not_fit_its_bytes_is_noticed(index: bytes) -> None:
    with pytest.raises(DamagedData):
        unpack(_sealed(struct.pack("<I", len(index)) + index + bytes(12)))


# --- Columns of decimals come back bit for bit, others are left alone, and damage is noticed.


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
        assert len(stored) < len(encode(column)) + 64
    if stored is not None:
        assert same_bits(decode_decimals(stored, length), column)


@pytest.mark.parametrize("other", [float("nan"), float("inf"), 0.1 + 1.4e-17, 5e-324, 1e300, 1 / 3, -1e12])
def test_one_value_that_is_no_decimal_or_steps_too_far_leaves_the_column_alone(other: float) -> None:
    """The double next to a decimal, what no float of 53 bits counts: none is changed by being stored."""
    column = np.round(np.arange(1, 100_001) / 1000, 3)
    column[[0, 50_000, -1]] = -0.0
    whole = encode_decimals(column)
    assert same_bits(decode_decimals(whole, column.size), column)
    column[77_777] = other
    assert encode_decimals(column) is None


@given(st.integers(0, 60_000), st.integers(1, 255))
@settings(deadline=None, max_examples=30)
def test_damaged_decimals_are_noticed(place: int, change: int) -> None:
    stored = encode_decimals(np.round(np.random.default_rng(0).standard_normal(30_000), 2))
    broken = bytearray(stored)
    broken[place % len(stored)] ^= change
    with pytest.raises(DamagedData):
        decode_decimals(broken, 30_000)
    with pytest.raises(DamagedData):
        decode_decimals(stored, 29_999)
    with pytest.raises(DamagedData):
        decode_decimals(stored[:20], 30_000)
