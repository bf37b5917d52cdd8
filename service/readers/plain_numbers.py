"""Columns of plain decimal numbers in a text, eight digits at a time, to the double nearest to each.

A cell is `[-]digits[.digits]`. Its digits before and behind the point are each the bytes of one integer of 64 bits, of which
three multiplications make their value. The whole mantissa stays below 2⁵³ and is divided by a power of ten that a double
holds exactly, so that the one rounding is that of the division. Source: W. D. Clinger, How to read floating point numbers
accurately, PLDI 1990; D. Lemire, Number parsing at a gigabyte per second, Software 51 (2021), for the multiplications.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray

_COMMA, _NEWLINE, _POINT, _MINUS = b",\n.-"
_DIGITS = 8
_POWERS = np.array([10.0**power for power in range(_DIGITS + 1)])
#: Integers below this are doubles, and all of fewer digits.
_MOST_EXACT, _DIGITS_EXACT = 2**53, 16
#: What is left of eight bytes: the values of the digits of the last so many of them.
_MASKS = np.array(
    [0x0F0F0F0F0F0F0F0F & ~((1 << 8 * (_DIGITS - digits)) - 1) for digits in range(_DIGITS + 1)], np.uint64
)
#: Factors that add neighbouring digits, pairs and fours.
_TENS, _HUNDREDS, _TEN_THOUSANDS = np.uint64(2561), np.uint64(6553601), np.uint64(42949672960001)
_Words = NDArray[np.uint64]


def plain_columns(block: bytes, width: int, columns: Iterable[int]) -> list[NDArray[Any]] | None:
    """The columns [rows] of a block of lines with `width` cells separated by commas; None if any cell is not a plain
    number, or has more than eight digits before or after its decimal point."""
    if not block or block.translate(None, b"0123456789,.-\n"):
        return None
    text = np.frombuffer(block, np.uint8)
    ends = np.flatnonzero(text < _MINUS)  # commas and line feeds
    if ends.size % width or not _even(text[ends].reshape(-1, width)):
        return None
    starts = np.empty_like(ends)
    starts[0], starts[1:] = 0, ends[:-1] + 1
    signs = block.count(b"-")
    if signs and signs != np.count_nonzero(text[starts] == _MINUS):
        return None
    points = _points(text, ends)
    if points is None:
        return None
    padded = np.frombuffer(bytes(_DIGITS) + block, np.uint8)
    words = np.lib.stride_tricks.as_strided(padded[:_DIGITS].view(np.uint64), (text.size + 1,), (1,), writeable=False)
    read = []
    for column in columns:
        own = slice(column, None, width)
        negative = text[starts[own]] == _MINUS if signs else None
        values = _numbers(words, starts[own], points[own], ends[own], negative)
        if values is None:
            return None
        read.append(values)
    return read


def _even(marks: NDArray[np.uint8]) -> bool:
    """Whether the separators after cells [rows, width] are a line end after each row and a comma elsewhere."""
    return bool((marks[:, -1] == _NEWLINE).all() and (marks[:, :-1] == _COMMA).all())


def _points(text: NDArray[np.uint8], ends: NDArray[np.intp]) -> NDArray[np.intp] | None:
    """The position of each cell's decimal point, its end if it has none; None if a cell has two."""
    points = np.flatnonzero(text == _POINT)
    if points.size == ends.size and (points < ends).all() and (points[1:] > ends[:-1]).all():
        return points
    cells = np.searchsorted(ends, points)
    if (np.diff(cells) == 0).any():
        return None
    placed = ends.copy()
    placed[cells] = points
    return placed


def _numbers(
    words: _Words,
    starts: NDArray[np.intp],
    points: NDArray[np.intp],
    ends: NDArray[np.intp],
    negative: NDArray[np.bool_] | None,
) -> FloatArray | None:
    """The values of a column's cells; None if one has no digit, or too many."""
    before, behind = points - starts, ends - points
    if negative is not None:
        before -= negative
    least, most = int(behind.min()), int(behind.max())
    if before.max() > _DIGITS or most - 1 > _DIGITS or ((before == 0) & (behind <= 1)).any():
        return None
    if least == most and before.max() + most <= _DIGITS:
        values = _together(words[ends], before, most)
    elif most <= 1:  # no digit behind any point
        values = _value(words[points] & _MASKS[before]).astype(np.float64)
    else:
        decimals = most - 1 if least == most else np.maximum(behind - 1, 0)
        power = _POWERS[decimals]
        values = _value(words[points] & _MASKS[before]).astype(np.float64) * power + _value(
            words[ends] & _MASKS[decimals]
        )
        if before.max() + most - 1 >= _DIGITS_EXACT and values.max() >= _MOST_EXACT:
            return None
        values /= power
    if negative is not None:
        np.negative(values, out=values, where=negative)
    return np.asarray(values, dtype=np.float64)


def _together(last: _Words, before: NDArray[np.intp], behind: int) -> FloatArray:
    """The values of cells of at most eight bytes, all with the same number of characters `behind` from the decimal
    point on: the digits before the point are shifted over it."""
    decimals = max(behind - 1, 0)
    if behind:
        fraction = _MASKS[decimals] * np.uint64(0x11)  # all of a byte
        last = (last & fraction) | ((last << np.uint64(8)) & ~fraction)
    values = _value(last & _MASKS[before + decimals]).astype(np.float64)
    if decimals:
        values /= _POWERS[decimals]
    return np.asarray(values, dtype=np.float64)


def _value(digits: _Words) -> _Words:
    """The number with these eight decimal digits, the first of them in the lowest byte."""
    value = (digits * _TENS >> np.uint64(8)) & np.uint64(0x00FF00FF00FF00FF)
    value = (value * _HUNDREDS >> np.uint64(16)) & np.uint64(0x0000FFFF0000FFFF)
    return value * _TEN_THOUSANDS >> np.uint64(32)
