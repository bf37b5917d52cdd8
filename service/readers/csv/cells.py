"""Blocks of CSV made plain: comments and blank lines left out, then the cells of the columns taken picked out.

Whole blocks at a time, whatever the columns that are not taken hold. A separator counts where an even number of
quotes stands before it; a quote may only begin a cell, end one, or be doubled in one (RFC 4180).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from service.readers.csv.lines import is_comment, text_of

#: The separator between picked cells.
INNER = b";"

_NEWLINE, _QUOTE = b'\n"'
#: Letters that a comment or a blank line may begin with, behind blanks and quotes.
_DOUBTFUL = np.zeros(256, dtype=np.bool_)
_DOUBTFUL[list(b'#%/; \t\n"')] = True


def without_comments(block: bytes, separator: str) -> tuple[bytes, list[int]]:
    """A block of whole lines without comments and blank lines; for each line left out, how many kept lines precede it."""
    letters = np.frombuffer(block, np.uint8)
    stops = np.flatnonzero(letters == _NEWLINE) + 1
    starts = np.concatenate([[0], stops[:-1]])
    first = letters[starts]
    left_out = (first == _NEWLINE) | (first == b"#"[0]) | (first == b"%"[0])
    doubtful = _DOUBTFUL[first] & ((first != _QUOTE) | _DOUBTFUL[letters[np.minimum(starts + 1, letters.size - 1)]])
    for line in np.flatnonzero(doubtful & ~left_out).tolist():
        text = text_of(block[starts[line] : stops[line] - 1])
        left_out[line] = not text.strip() or is_comment(text, separator)
    if not left_out.any():
        return block, []
    kept = np.repeat(~left_out, stops - starts)
    return letters[kept].tobytes(), np.cumsum(~left_out)[left_out].tolist()


def picked(block: bytes, separator: bytes, width: int, taken: Sequence[int]) -> bytes | None:
    """The cells of columns `taken` (ascending) of lines of `width` cells each, without quotes, with INNER between them.

    None where a line has another number of cells, or a quote stands where none may.
    """
    letters = np.frombuffer(bytearray(block), np.uint8)
    ends_line = letters == _NEWLINE
    ends_cell = (letters == separator[0]) | ends_line
    quote = letters == _QUOTE if b'"' in block else None
    if quote is not None:
        inside = np.cumsum(quote, dtype=np.uint8) & 1 != 0
        if (ends_line & inside).any() or not _well_placed(np.flatnonzero(quote), letters, separator[0]):
            return None
        ends_cell &= ~inside
    after = np.flatnonzero(ends_cell)
    if after.size == 0 or after.size % width or np.count_nonzero(ends_line) != after.size // width:
        return None
    if not ends_line[after[width - 1 :: width]].all():
        return None
    starts = np.concatenate([[0], after[:-1] + 1]).reshape(-1, width)[:, taken]
    ends = after.reshape(-1, width)[:, taken]
    change = np.zeros(letters.size + 1, dtype=np.int8)
    change[starts] += 1
    change[ends + 1] -= 1
    kept = np.cumsum(change[:-1], dtype=np.int8).view(np.bool_)
    if quote is not None:
        # A cell with quotes has the two about it and no more.
        if np.count_nonzero(quote & kept) != 2 * np.count_nonzero(letters[starts] == _QUOTE):
            return None
        kept &= ~quote
    letters[ends[:, :-1]] = INNER[0]
    letters[ends[:, -1]] = _NEWLINE
    return letters[kept].tobytes()


def _well_placed(quotes: NDArray[np.intp], letters: NDArray[np.uint8], separator: int) -> bool:
    """Whether quotes, which open and close in turn, are at the ends of cells or, doubled, next to each other."""
    before, after = (
        letters[quotes[0::2] - 1],
        letters[quotes[1::2] + 1],
    )  # before the first stands the last: a line feed
    return all(bool(np.isin(beside, (separator, _NEWLINE, _QUOTE)).all()) for beside in (before, after))
