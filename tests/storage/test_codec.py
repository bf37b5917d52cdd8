"""Bit equality of stored columns and packed arrays, and that damage is noticed."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from storage.encoding import CODEC, decode, decode_decimals, encode, encode_decimals, pack, unpack
from storage.engine.errors import DamagedData
from tests.storage.floats import same_bits

AWKWARD = [0.0, -0.0, 5e-324, -2.2e-308, 1e308, -1.7976931348623157e308, float("inf"), float("-inf"), 0.1, 1 / 3]


@given(hnp.arrays(np.uint64, st.integers(0, 400)))
def test_any_bits_come_back(pattern: NDArray[np.uint64]) -> None:
    column = pattern.view(np.float64)  # NaNs with any payload among them
    assert same_bits(decode(encode(column), CODEC, column.size), column)


@given(hnp.arrays(np.float64, st.integers(0, 400), elements=st.floats(width=64) | st.sampled_from(AWKWARD)))
def test_any_floats_come_back(column: NDArray[np.float64]) -> None:
    assert same_bits(decode(encode(column), CODEC, column.size), column)


@pytest.mark.parametrize("length", [1, 1 << 14, (1 << 14) + 1, 100_000])
def test_long_columns_come_back_with_planes_of_noise_kept_plain(length: int) -> None:
    rng = np.random.default_rng(length)
    for column in (rng.standard_normal(length), np.round(rng.standard_normal(length), 3), np.full(length, 5.0)):
        assert same_bits(decode(encode(column), CODEC, length), column)


def test_a_plane_that_is_noise_only_outside_the_probe_comes_back() -> None:
    """The probe looks at the middle: here it is quiet and the ends are noise, then the other way round."""
    rng = np.random.default_rng(3)
    quiet_middle = rng.standard_normal(200_000)
    quiet_middle[80_000:120_000] = 1.0
    quiet_ends = np.ones(200_000)
    quiet_ends[80_000:120_000] = rng.standard_normal(40_000)
    for column in (quiet_middle, quiet_ends):
        assert same_bits(decode(encode(column), CODEC, column.size), column)


def test_what_is_read_may_be_written_to_and_strides_do_not_matter() -> None:
    column = np.arange(20.0)[::-2]
    back = decode(encode(column), CODEC, column.size)
    back[0] = -1.0
    assert same_bits(back[1:], column[1:])


def test_smooth_columns_shrink_and_noise_hardly_grows() -> None:
    time = np.round(np.arange(100_000) / 1000, 3)
    assert len(encode(time)) < time.nbytes / 20
    noise = np.random.default_rng(0).integers(0, 2**63, 10_000).view(np.float64)
    assert len(encode(noise)) <= noise.nbytes + 36


@pytest.mark.parametrize(
    "column", [np.arange(3), np.zeros(3, ">f8"), np.zeros(3, np.float32), np.zeros((2, 2)), np.array(1.0)]
)
def test_only_a_row_of_64_bit_floats_is_taken(column: NDArray[np.float64]) -> None:
    with pytest.raises(ValueError, match="one row of float64"):
        encode(column)


@pytest.mark.parametrize("length", [0, 49, 51, 1_000_000])
def test_another_length_is_noticed(length: int) -> None:
    with pytest.raises(DamagedData):
        decode(encode(np.arange(50.0)), CODEC, length)


def test_another_codec_is_named() -> None:
    with pytest.raises(DamagedData, match="zstd"):
        decode(b"", "zstd", 0)


def test_the_stored_bytes_are_little_endian_wherever_they_were_written() -> None:
    """A column of one value keeps its eight planes plain: the value's own bytes, least significant first."""
    assert encode(np.array([-1.5]))[-8:] == struct.pack("<d", -1.5)


def test_a_plane_in_which_only_neighbours_repeat_is_read_back() -> None:
    """Long enough for its deflater to be chosen by a probe: noise, steps, a clock and constants, each bit for bit."""
    rng = np.random.default_rng(1)
    noise = np.round(20 + 0.25 * rng.standard_normal(100_000), 4)
    for column in (noise, np.repeat(noise[:1000], 100), np.round(np.arange(100_000) / 1000, 3), np.zeros(100_000)):
        kept = encode(column)
        assert decode(kept, CODEC, column.size).tobytes() == column.tobytes()
        assert len(kept) < column.nbytes


def test_every_damaged_byte_is_noticed() -> None:
    column = np.round(np.random.default_rng(1).standard_normal(60), 2)
    stored = encode(column)
    for position in range(len(stored)):
        damaged = bytearray(stored)
        damaged[position] ^= 0x10
        with pytest.raises(DamagedData):
            decode(bytes(damaged), CODEC, column.size)


@pytest.mark.parametrize("cut", [0, 3, 20, 36, -1])
def test_a_cut_off_column_is_noticed(cut: int) -> None:
    with pytest.raises(DamagedData):
        decode(encode(np.arange(50.0))[:cut], CODEC, 50)


@given(
    st.dictionaries(
        st.text(max_size=8),
        hnp.arrays(np.uint64, hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5)),
        max_size=4,
    )
)
def test_packed_arrays_come_back(patterns: dict[str, NDArray[np.uint64]]) -> None:
    arrays = {name: np.asarray(pattern.view(np.float64)) for name, pattern in patterns.items()}
    back = unpack(pack(arrays))
    assert list(back) == list(arrays)
    assert all(back[name].shape == array.shape and same_bits(back[name], array) for name, array in arrays.items())


@given(
    hnp.arrays(
        np.float64, hnp.array_shapes(min_dims=1, max_dims=3, min_side=0), elements=st.sampled_from([0.0, 1.0, -0.0])
    )
)
def test_flags_come_back(array: NDArray[np.float64]) -> None:
    back = unpack(pack({"flags": array}))["flags"]
    assert back.shape == array.shape
    assert same_bits(back, array)


def test_flags_take_a_bit_each_and_states_of_earlier_releases_are_read() -> None:
    flags = np.eye(64)
    assert len(pack({"flags": flags})) < 64 * 64 / 8 + 50
    index = b'[["flags",[64,64]]]'
    plain = _sealed(struct.pack("<I", len(index)) + index + flags.tobytes())
    assert same_bits(unpack(plain)["flags"], flags)


def test_packing_takes_64_bit_floats_only_and_names_the_array() -> None:
    with pytest.raises(ValueError, match="weights must be of float64, got float32"):
        pack({"weights": np.zeros(3, np.float32)})


def test_every_damaged_byte_of_packed_arrays_is_noticed() -> None:
    column = np.round(np.random.default_rng(1).standard_normal(60), 2)
    packed = pack({"a": column, "b": column[:3]})
    for position in range(len(packed)):
        damaged = bytearray(packed)
        damaged[position] ^= 0x10
        with pytest.raises(DamagedData):
            unpack(bytes(damaged))


@pytest.mark.parametrize("cut", [0, 3, 20, 36, -1])
def test_arrays_that_are_cut_off_are_noticed(cut: int) -> None:
    with pytest.raises(DamagedData):
        unpack(pack({"a": np.arange(50.0)})[:cut])


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
