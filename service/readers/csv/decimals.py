"""Decimal numbers in text -> float64, whole blocks at a time and exactly rounded, as Python's `float` reads them.

A block is cut at separators, line ends, points and exponents. A run of at most eight digits is one 64-bit word, and three
multiplications turn such a word into its value (the digits are added in pairs, then fours, then eights); so a number is
mantissa · 10^k with both known as integers. Where the mantissa is below 2^53 and |k| <= 22 both are exact in float64, so one
multiplication or division rounds once and correctly (W. D. Clinger, How to read floating point numbers accurately, PLDI
1990, section 3). The few others go through `float`.
"""

import re
import sys

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray

Words = NDArray[np.uint64]
Indices = NDArray[np.intp]

#: A number: no hexadecimals, no underscores, no words but nan and inf, which `check_arrays` refuses with their row. Digits
#: are never given back, or a long run of them with a letter behind it would be tried from every digit to every other.
NUMBER = re.compile(r"[+-]?(\d++(\.\d*+)?|\.\d++)([eE][+-]?\d{1,4})?|[+-]?(nan|inf|infinity)", re.IGNORECASE | re.ASCII)

_NEWLINE, _POINT, _PLUS, _MINUS, _SMALL_E, _LARGE_E = b"\n.+-eE"
_EXACT_POWERS = 10.0 ** np.arange(23)
_WHOLE_POWERS = np.array([10**power for power in range(20)], dtype=np.uint64)
_WORD = 8


def parse_rows(text: bytes, separator: int, columns: int) -> FloatArray | None:
    """Lines of `columns` numbers each, every line ended by a newline -> [rows, columns].

    `separator` is the byte between numbers; the decimal sign is a point. None where the text holds anything
    else: the caller then looks for the place line by line.
    """
    if sys.byteorder != "little" or not text:
        return None
    padded = b"\n" * _WORD + text
    letters = np.frombuffer(padded, np.uint8)[_WORD:]
    ends_cell = letters == separator
    ends_cell |= letters == _NEWLINE
    marked = ends_cell | (letters == _POINT)
    exponents = b"e" in text or b"E" in text
    if exponents:
        marked |= (letters | 0x20) == _SMALL_E
    ends = np.flatnonzero(marked)
    last = np.flatnonzero(ends_cell[ends])
    closing = letters[ends[last]]
    if last.size % columns or not (closing.reshape(-1, columns)[:, -1] == _NEWLINE).all():
        return None
    if np.count_nonzero(closing == _NEWLINE) != last.size // columns:
        return None
    numbers = _assemble(text, padded, letters, ends, last, exponents=exponents)
    return None if numbers is None else numbers.reshape(-1, columns)


def _assemble(
    text: bytes, padded: bytes, letters: NDArray[np.uint8], ends: Indices, last: Indices, *, exponents: bool
) -> FloatArray | None:
    """The numbers whose last pieces end at `ends[last]`; None where one is not a number."""
    starts = np.empty_like(ends)
    starts[0] = 0
    starts[1:] = ends[:-1] + 1
    first_letter = letters[starts]
    negative = first_letter == _MINUS
    signed = negative | (first_letter == _PLUS)
    digits = ends - starts
    digits -= signed
    values, good = _runs_of_digits(padded, ends, digits)

    first = np.empty_like(last)
    first[0] = 0
    first[1:] = last[:-1] + 1
    power = np.zeros(last.size, dtype=np.intp)
    fraction_at = last
    if exponents:
        has_exponent = (letters[starts[last] - 1] | 0x20) == _SMALL_E
        has_exponent &= last > first
        if (has_exponent & ((digits[last] < 1) | (digits[last] > 4))).any():
            return None
        size = np.where(has_exponent, values[last], 0).astype(np.intp)
        power = np.where(negative[last], -size, size)
        fraction_at = last - has_exponent
    has_fraction = fraction_at > first
    if (fraction_at - first > 1).any() or (signed[fraction_at] & has_fraction).any():
        return None
    if exponents and (letters[starts[fraction_at[has_fraction]] - 1] != _POINT).any():
        return None
    decimals = np.where(has_fraction, digits[fraction_at], 0)
    figures = digits[first] + decimals
    if not good or figures.min() < 1:
        return None

    mantissa = values[fraction_at]
    mantissa += np.where(has_fraction, values[first] * _WHOLE_POWERS[np.minimum(decimals, 19)], np.uint64(0))
    power -= decimals
    read_whole = (digits[first] <= 16) & (decimals <= 16)
    plain = read_whole & (figures <= 19) & (mantissa <= 2**53) & (np.abs(power) <= 22)
    numbers = mantissa.astype(np.float64)
    scale = _EXACT_POWERS[np.minimum(np.abs(power), 22)]
    np.divide(numbers, scale, out=numbers, where=power < 0)
    if exponents:
        np.multiply(numbers, scale, out=numbers, where=power > 0)
    np.negative(numbers, out=numbers, where=negative[first])
    others = np.flatnonzero(~plain)
    cells = [
        text[start:end] for start, end in zip(starts[first[others]].tolist(), ends[last[others]].tolist(), strict=True)
    ]
    # Digits beyond the sixteenth of a run have not been looked at.
    for index in np.flatnonzero(~read_whole[others]):
        if not NUMBER.fullmatch(cells[index].decode("latin-1")):
            return None
    numbers[others] = [float(cell) for cell in cells]
    return numbers


def _runs_of_digits(padded: bytes, ends: Indices, count: Indices) -> tuple[Words, bool]:
    """The values of the last sixteen of `count` digits before `ends`, and whether all of those are digits."""
    words = np.ndarray((len(padded) - _WORD + 1,), "<u8", padded, 0, (1,))
    values, good = _eight_digits(words[ends], np.minimum(count, _WORD))
    long = np.flatnonzero(count > _WORD)
    if long.size:
        higher, also = _eight_digits(words[ends[long] - _WORD], np.minimum(count[long] - _WORD, _WORD))
        values[long] += higher * np.uint64(10**_WORD)
        good &= also
    return values, good


def _eight_digits(word: Words, count: Indices) -> tuple[Words, bool]:
    """Words whose last `count` letters are digits -> their values, and whether they all are digits. Changes `word`."""
    unused = (64 - 8 * count).astype(np.uint64)
    word ^= np.uint64(0x3030303030303030)
    word >>= unused
    word <<= unused  # a shift by all 64 bits leaves nothing
    stray = word + np.uint64(0x7676767676767676)
    stray |= word
    stray &= np.uint64(0x8080808080808080)
    good = not stray.any()
    pairs = word >> np.uint64(8)
    word *= np.uint64(10)
    word += pairs
    fours = word >> np.uint64(16)
    word &= np.uint64(0x000000FF000000FF)
    word *= np.uint64(0x000F424000000064)
    fours &= np.uint64(0x000000FF000000FF)
    fours *= np.uint64(0x0000271000000001)
    word += fours
    word >>= np.uint64(32)
    return word, good
