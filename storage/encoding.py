"""Encodes columns of 64-bit floats as bytes, and restores them bit for bit. Signed zeros, subnormals and the payload of a
NaN survive.

`shuffle-zlib` stores one column. The eight bytes of every little-endian float go to eight planes, so that signs and
exponents, which hardly change from sample to sample, lie together and deflate well; a plane of noise (the low bytes of a
measured mantissa) would cost time and gain nothing, and is stored plain. A plane in which only neighbouring bytes repeat is
deflated by run lengths alone (Z_RLE), which is twice as fast; the same code inflates it.

    crc32 of the rest (4 bytes) | bytes of each plane (8 x 4 bytes) | the planes, least significant byte first

A plane as long as the column is stored plain, a shorter one is deflated.

`pack` stores several named arrays of any shape, plain: filter states, which are rewritten at every run. An array of nothing
but 0 and 1, as the particles' flags of outlying runs, takes a bit a value: [name, shape, "bits"].

    crc32 of the rest (4 bytes) | bytes of the index (4 bytes) | index, JSON [[name, shape], ...] | the arrays' bytes

`decimal-zlib` stores a column whose values are all k / 10^d with whole k: d, the first k, and the steps from each k to the
next, so that slow signals give small numbers. A step s is stored as 2s, or -2s - 1 where it is negative, in four bytes that
go to planes likewise. k below 2^53 and 10^d up to 10^15 are exact in 64-bit floats, so k / 10^d is rounded
once: it is the double nearest to the decimal. A column that holds any other double is not stored this way.

    crc32 of the rest (4 bytes) | d (1 byte) | first k (8 bytes) | bytes of each plane (4 x 4 bytes) | the planes |
    rows that are minus zero, which k does not distinguish from zero (4 bytes each)

JSON in text columns is compact, and without NaN or infinities: the library's functions, nothing of our own at every row.
"""

import json
import math
import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from storage.engine.errors import DamagedData

CODEC = "shuffle-zlib"

_PLANES = 8
_PLANE_SIZES = struct.Struct("<8I")
_NUMBER = struct.Struct("<I")
_BITS = "bits"
#: A longer plane is deflated only where its middle 16 KiB shrink below 80 %: a smaller gain is not worth the time.
_PROBE = 1 << 14
_WORTH_IT = 0.8
#: A plane is deflated by run lengths alone where that makes the probe longer by no more than this factor.
_NO_LONGER = 1.02


def encode(column: NDArray[np.float64]) -> bytearray:
    """The column [n] as bytes for `decode`. Raises ValueError unless it is one row of 64-bit floats."""
    if column.dtype != np.float64 or column.ndim != 1:
        raise ValueError(f"a column must be one row of float64, got {column.dtype} of shape {column.shape}")
    shuffled = np.ascontiguousarray(column, dtype="<f8").view(np.uint8).reshape(-1, _PLANES).T
    data = bytearray(_NUMBER.size + _PLANE_SIZES.size)
    _PLANE_SIZES.pack_into(data, _NUMBER.size, *_append_planes(data, shuffled))
    _seal(data)
    return data


def decode(data: bytes | bytearray, codec: str, length: int) -> NDArray[np.float64]:
    """The column [length] from the bytes of `encode`. Raises DamagedData if the bytes have changed."""
    if codec != CODEC:
        raise DamagedData(f"a column is stored with the codec {codec!r}, this release knows {CODEC!r}")
    body = _unsealed(data, at_least=_PLANE_SIZES.size)
    sizes = _PLANE_SIZES.unpack_from(body)
    if sum(sizes) + _PLANE_SIZES.size != len(body) or max(sizes) > length:
        raise DamagedData(
            f"a stored column of {length} values has parts of {sizes} bytes, but {len(body)} bytes in all"
        )
    shuffled = _read_planes(body[_PLANE_SIZES.size :], sizes, length)
    return np.ascontiguousarray(shuffled.T).view("<f8").reshape(length).astype(np.float64, copy=False)


def pack(arrays: Mapping[str, NDArray[np.float64] | NDArray[np.bool_]]) -> bytes:
    """Named arrays of any shape as bytes, order kept, flags (0 and 1, or booleans) as bits.

    Raises ValueError on an array that is of neither 64-bit floats nor booleans.
    """
    index: list[tuple[object, ...]] = []
    parts: list[bytes] = []
    for name, array in arrays.items():
        if array.dtype not in (np.float64, np.bool_):
            raise ValueError(f"{name} must be of float64 or bool, got {array.dtype}")
        flags = _flags(array)
        if flags is not None:
            index.append((name, array.shape, _BITS))
            parts.append(np.packbits(flags).tobytes())
        else:
            index.append((name, array.shape))
            parts.append(array.astype("<f8", copy=False).tobytes())
    names = json.dumps(index, separators=(",", ":")).encode()
    data = bytearray(_NUMBER.size) + _NUMBER.pack(len(names)) + names + b"".join(parts)
    _seal(data)
    return bytes(data)


def _flags(array: NDArray[np.float64] | NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    """An array of 0 and 1 alone as booleans, None for any other."""
    if array.dtype == np.bool_:
        return array.astype(np.bool_, copy=False)
    flags: NDArray[np.bool_] = array == 1.0
    return flags if (flags | ((array == 0.0) & ~np.signbit(array))).all() else None


def unpack(data: bytes, *, booleans: bool = False) -> dict[str, NDArray[np.float64] | NDArray[np.bool_]]:
    """The arrays from the bytes of `pack`; with `booleans` flags are booleans, an eighth of the memory. Raises
    DamagedData if the bytes have changed."""
    body = _unsealed(data, at_least=_NUMBER.size)
    start = _NUMBER.size + _NUMBER.unpack_from(body)[0]
    try:
        index = json.loads(bytes(body[_NUMBER.size : start]))
        arrays: dict[str, NDArray[np.float64] | NDArray[np.bool_]] = {}
        for name, shape, *form in index:
            array, start = _unpacked(body, start, shape, form)
            arrays[name] = array if booleans else array.astype(np.float64, copy=False)
    except (ValueError, TypeError) as error:
        raise DamagedData(f"packed arrays do not unpack: {error}") from error
    if start != len(body):
        raise DamagedData(f"packed arrays end at byte {start} of {len(body)}")
    return arrays


def _unpacked(
    body: memoryview, start: int, shape: list[int], form: list[str]
) -> tuple[NDArray[np.float64] | NDArray[np.bool_], int]:
    """The array that begins at `start`, and the position of its end."""
    size = math.prod(shape)
    if not form:
        values = np.frombuffer(body, dtype="<f8", count=size, offset=start)
        return values.reshape(shape).astype(np.float64), start + values.nbytes
    if form != [_BITS] or size < 0:
        raise ValueError(f"{size} values in the form {form}")
    bits = np.frombuffer(body, dtype=np.uint8, count=math.ceil(size / 8), offset=start)
    return np.unpackbits(bits, count=size).reshape(shape).view(np.bool_), start + bits.nbytes


def _append_planes(data: bytearray, planes: NDArray[np.uint8]) -> list[int]:
    """Append planes [k, n] to `data`, deflated if that saves enough; returns the bytes of each plane."""
    sizes = []
    for plane in planes:
        before = len(data)
        data += _deflate(np.ascontiguousarray(plane).data)
        sizes.append(len(data) - before)
    return sizes


def _read_planes(body: memoryview, sizes: Sequence[int], length: int) -> NDArray[np.uint8]:
    """The planes [k, length] from the bytes of `_append_planes`, of the given sizes. Raises DamagedData."""
    planes = np.empty((len(sizes), length), dtype=np.uint8)
    start = 0
    for row, size in zip(planes, sizes, strict=True):
        row[:] = _inflate(body[start : start + size], length)
        start += size
    return planes


def _seal(data: bytearray) -> None:
    """Write the checksum of all bytes from the fifth on into the first four."""
    _NUMBER.pack_into(data, 0, zlib.crc32(memoryview(data)[_NUMBER.size :]))


def _deflate(plane: memoryview) -> bytes | memoryview:
    strategy = zlib.Z_DEFAULT_STRATEGY
    if len(plane) > _PROBE:
        middle = (len(plane) - _PROBE) // 2
        probe = plane[middle : middle + _PROBE]
        whole, runs = len(_compressed(probe, strategy)), len(_compressed(probe, zlib.Z_RLE))
        if min(whole, runs) >= _WORTH_IT * _PROBE:
            return plane
        strategy = zlib.Z_RLE if runs <= _NO_LONGER * whole else strategy
    deflated = _compressed(plane, strategy)
    return deflated if len(deflated) < len(plane) else plane


def _compressed(plane: memoryview, strategy: int) -> bytes:
    deflater = zlib.compressobj(level=1, strategy=strategy)
    return deflater.compress(plane) + deflater.flush()


def _inflate(stored: memoryview, length: int) -> NDArray[np.uint8]:
    if len(stored) == length:
        return np.frombuffer(stored, dtype=np.uint8)
    inflater = zlib.decompressobj()
    try:
        plane = inflater.decompress(stored, length + 1)
    except zlib.error as error:
        raise DamagedData(f"a part of a stored column cannot be unpacked: {error}") from error
    if len(plane) != length or not inflater.eof:
        raise DamagedData(f"a part of a stored column must unpack to {length} bytes, got {len(plane)}")
    return np.frombuffer(plane, dtype=np.uint8)


def _unsealed(data: bytes | bytearray, *, at_least: int) -> memoryview:
    """The bytes from the fifth on, checked against the checksum in the first four. Raises DamagedData."""
    if len(data) < _NUMBER.size + at_least:
        raise DamagedData(f"stored numbers are cut off after {len(data)} bytes")
    body = memoryview(data)[_NUMBER.size :]
    if zlib.crc32(body) != _NUMBER.unpack_from(data)[0]:
        raise DamagedData(f"stored numbers of {len(data)} bytes fail their checksum")
    return body


DECIMAL_CODEC = "decimal-zlib"

#: Shorter columns gain too little to be stored this way.
LONG = 1 << 12
_MAX_DECIMALS = 15
_LARGEST_STEP = 1 << 30
#: Values probed first, and encoded at a time.
_PROBED, _PIECE = 64, 1 << 14
_HEAD = struct.Struct("<Bq4I")
_STEP_PLANES = 4


def encode_decimals(column: NDArray[np.float64]) -> bytearray | None:
    """A column [n] as bytes for `decode_decimals`; None if its values are no short decimals."""
    probe = column[:: max(1, column.size // _PROBED)]
    decimals = next((d for d in range(_MAX_DECIMALS + 1) if _whole(probe, d) is not None), None)
    head = None if decimals is None else _whole(column[:1], decimals)
    if decimals is None or head is None:
        return None
    folded, last = np.empty(column.size, dtype="<u4"), head
    for start in range(0, column.size, _PIECE):
        integers = _whole(column[start : start + _PIECE], decimals)
        if integers is None:
            return None
        steps = np.diff(integers, prepend=last)
        if int(steps.max()) >= _LARGEST_STEP or int(steps.min()) <= -_LARGEST_STEP:
            return None
        folded[start : start + _PIECE] = (steps << 1) ^ (steps >> 63)
        last = integers[-1:]
    minus = np.flatnonzero((column == 0) & np.signbit(column))
    data = bytearray(_NUMBER.size + _HEAD.size)
    sizes = _append_planes(data, folded.view(np.uint8).reshape(-1, _STEP_PLANES).T)
    data += minus.astype("<u4").tobytes()
    _HEAD.pack_into(data, _NUMBER.size, decimals, int(head[0]), *sizes)
    _seal(data)
    return data


def _whole(column: NDArray[np.float64], decimals: int) -> NDArray[np.int64] | None:
    """The integers k [n] of a column that equals k / 10^decimals in every bit but the sign of a zero; None if it does
    not."""
    scale = 10.0**decimals
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = column * scale
        np.rint(scaled, out=scaled)
        if not (np.abs(scaled) < 2.0**53).all():
            return None
        integers = scaled.astype(np.int64)
    return integers if np.array_equal(integers / scale, column) else None


def decode_decimals(data: bytes | bytearray, length: int) -> NDArray[np.float64]:
    """The column [length] from the bytes of `encode_decimals`. Raises DamagedData if the bytes have changed."""
    body = _unsealed(data, at_least=_HEAD.size)
    decimals, first, *sizes = _HEAD.unpack_from(body)
    end = sum(sizes) + _HEAD.size
    minus = np.frombuffer(body[end:], dtype="<u4") if end <= len(body) and (len(body) - end) % 4 == 0 else None
    if minus is None or max(sizes) > length or decimals > _MAX_DECIMALS or (minus >= length).any():
        raise DamagedData(
            f"a stored column of {length} decimals has parts of {sizes} bytes, but {len(body)} bytes in all"
        )
    planes = _read_planes(body[_HEAD.size :], sizes, length)
    folded = np.ascontiguousarray(planes.T).view("<u4").reshape(length).astype(np.int64)
    folded = (folded >> 1) ^ -(folded & 1)
    folded[:1] += first
    column = np.asarray(np.cumsum(folded, out=folded) / 10.0**decimals, dtype=np.float64)
    column[minus] = -0.0
    return column


Json: TypeAlias = dict[str, Any]

#: Compact JSON text. Raises ValueError on NaN or an infinity, TypeError on a value that JSON does not have.
to_text: Callable[[object], str] = json.JSONEncoder(allow_nan=False, ensure_ascii=False, separators=(",", ":")).encode
#: The object that `to_text` wrote.
to_object: Callable[[str], Json] = json.loads
#: The list that `to_text` wrote.
to_list: Callable[[str], list[Any]] = json.loads
