"""Long columns of decimals, as recorders round them, bit for bit in a third of the bytes.

`decimal-zlib` stores a column whose values are all k / 10^d with whole k: d, the first k, and the steps from each k to the
next, so that slow signals give small numbers. A step s is stored as 2s, or -2s - 1 where it is negative, in four bytes that
go to planes as in `codec`. k below 2^53 and 10^d up to 10^15 are exact in 64-bit floats, so k / 10^d is rounded
once: it is the double nearest to the decimal. A column that holds any other double is not stored this way.

    crc32 of the rest (4 bytes) | d (1 byte) | first k (8 bytes) | bytes of each plane (4 x 4 bytes) | the planes |
    rows that are minus zero, which k does not distinguish from zero (4 bytes each)
"""

import struct

import numpy as np
from numpy.typing import NDArray

from storage.encoding.codec import append_planes, read_planes, seal, unsealed
from storage.engine.errors import DamagedData

DECIMAL_CODEC = "decimal-zlib"

#: Shorter columns gain too little to be stored this way.
LONG = 1 << 12
_MOST_DECIMALS = 15
_LARGEST_STEP = 1 << 30
#: Values probed first, and encoded at a time.
_PROBED, _PIECE = 64, 1 << 14
_CHECKSUM_SIZE = 4
_HEAD = struct.Struct("<Bq4I")
_PLANES = 4


def encode_decimals(column: NDArray[np.float64]) -> bytearray | None:
    """A column [n] as bytes, to be read back by `decode_decimals`; None where it does not hold decimals."""
    probe = column[:: max(1, column.size // _PROBED)]
    decimals = next((d for d in range(_MOST_DECIMALS + 1) if _whole(probe, d) is not None), None)
    head = None if decimals is None else _whole(column[:1], decimals)
    if decimals is None or head is None:
        return None
    folded, last = np.empty(column.size, dtype="<u4"), head
    for start in range(0, column.size, _PIECE):
        whole = _whole(column[start : start + _PIECE], decimals)
        if whole is None:
            return None
        steps = np.diff(whole, prepend=last)
        if int(steps.max()) >= _LARGEST_STEP or int(steps.min()) <= -_LARGEST_STEP:
            return None
        folded[start : start + _PIECE] = (steps << 1) ^ (steps >> 63)
        last = whole[-1:]
    minus = np.flatnonzero((column == 0) & np.signbit(column))
    data = bytearray(_CHECKSUM_SIZE + _HEAD.size)
    sizes = append_planes(data, folded.view(np.uint8).reshape(-1, _PLANES).T)
    data += minus.astype("<u4").tobytes()
    _HEAD.pack_into(data, _CHECKSUM_SIZE, decimals, int(head[0]), *sizes)
    seal(data)
    return data


def _whole(column: NDArray[np.float64], decimals: int) -> NDArray[np.int64] | None:
    """k [n] of a column that is k / 10^decimals, every bit but the sign of a zero; None where it is not."""
    scale = 10.0**decimals
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = column * scale
        np.rint(scaled, out=scaled)
        if not (np.abs(scaled) < 2.0**53).all():
            return None
        whole = scaled.astype(np.int64)
    return whole if np.array_equal(whole / scale, column) else None


def decode_decimals(data: bytes | bytearray, length: int) -> NDArray[np.float64]:
    """The column [length] that `encode_decimals` was given. Raises DamagedData where the bytes are not what was stored."""
    body = unsealed(data, at_least=_HEAD.size)
    decimals, first, *sizes = _HEAD.unpack_from(body)
    end = sum(sizes) + _HEAD.size
    minus = np.frombuffer(body[end:], dtype="<u4") if end <= len(body) and (len(body) - end) % 4 == 0 else None
    if minus is None or max(sizes) > length or decimals > _MOST_DECIMALS or (minus >= length).any():
        raise DamagedData(f"{length} decimals are stored in planes of {sizes} bytes, {len(body)} bytes in all")
    planes = read_planes(body[_HEAD.size :], sizes, length)
    folded = np.ascontiguousarray(planes.T).view("<u4").reshape(length).astype(np.int64)
    folded = (folded >> 1) ^ -(folded & 1)
    folded[:1] += first
    column = np.asarray(np.cumsum(folded, out=folded) / 10.0**decimals, dtype=np.float64)
    column[minus] = -0.0
    return column
