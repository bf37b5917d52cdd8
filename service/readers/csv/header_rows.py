"""The rows above the data of a CSV file: separator, name row and unit row -> `Layout`.

    # bench 3, 2026-11-02      comments and blank lines, skipped
    time;torque                the name row (its names may hold units: torque [Nm])
    s;Nm                       the unit row, where there is one: a row of words under the names
    0,0;21,9                   the data

Where the file begins with numbers, the last comment above them may be the name row.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from service.readers.column_names import Header, header_of, with_unit
from service.readers.csv.decimals import NUMBER
from service.readers.csv.lines import cells_of, is_comment, text_of, wrong_line
from service.readers.limits import Limits

#: In the order in which they are looked for in the name row.
_SEPARATORS = "\t;,"


@dataclass(frozen=True, slots=True)
class Layout:
    """What the header rows say: the data begin at byte `start` of the first block, on line `line` (from 1)."""

    separator: str
    headers: tuple[Header, ...]
    start: int
    line: int


@dataclass(frozen=True, slots=True)
class _Row:
    """One line of the first block: its text, the bytes where it begins and ends, its number (from 1)."""

    text: str
    start: int
    end: int
    line: int


def read_header_rows(block: bytes, limits: Limits) -> Layout:
    """The layout that the first block states. Raises InvalidError where it has no header that can be understood."""
    separator, comment, line = "", "", 0
    for row in _rows(block):
        line, text = row.line, row.text.strip()
        if not text:
            continue
        if text.lower().startswith("sep=") and len(text) <= len("sep=") + 1:
            separator = text[4:] or "\t"
        elif is_comment(row.text, separator):
            comment = row.text.lstrip("#%/; \t")
        else:
            return _layout(block, row, comment, separator, limits)
    raise wrong_line(max(line, 1), "is the last that was read and no header came before it", "no_header")


def _rows(block: bytes, start: int = 0, line: int = 0) -> Iterator[_Row]:
    """The lines from byte `start` on, which follows line `line`."""
    while start < len(block):
        end = block.index(b"\n", start) + 1
        line += 1
        yield _Row(text_of(block[start : end - 1]), start, end, line)
        start = end


def _layout(block: bytes, first: _Row, comment: str, separator: str, limits: Limits) -> Layout:
    """The layout from the first row that is no comment: the name row, or data under a comment that has the names."""
    separator = separator or next((candidate for candidate in _SEPARATORS if candidate in first.text), ",")
    titles = _titles(first.text, separator, first.line, limits)
    if all(_is_number(title) for title in titles):
        names = _titles(comment, separator, first.line, limits) if comment else []
        if len(names) != len(titles):
            raise wrong_line(first.line, "must be a header with the channels' names", "no_header", first.text)
        return Layout(separator, tuple(map(header_of, names)), first.start, first.line)
    return _after_name_row(block, first, separator, [header_of(title) for title in titles])


def _after_name_row(block: bytes, names: _Row, separator: str, headers: list[Header]) -> Layout:
    """The layout with the unit row read, where the first row under the names that is no comment holds words only."""
    line = names.line
    for row in _rows(block, names.end, names.line):
        line = row.line
        if not row.text.strip() or is_comment(row.text, separator):
            continue
        cells = cells_of(row.text, separator)
        if any(cells) and not any(map(_is_number, cells)):
            return Layout(separator, _with_unit_row(headers, cells, row.line), row.end, row.line + 1)
        return Layout(separator, tuple(headers), row.start, row.line)
    return Layout(separator, tuple(headers), len(block), line + 1)


def _is_number(cell: str) -> bool:
    return NUMBER.fullmatch(cell.replace(",", ".")) is not None


def _titles(text: str, separator: str, line: int, limits: Limits) -> list[str]:
    titles = cells_of(text, separator)
    while titles and not titles[-1]:
        titles.pop()
    if len(titles) > limits.most_columns:
        raise wrong_line(line, f"must not have more than {limits.most_columns} columns, got {len(titles)}", "too_wide")
    return titles


def _with_unit_row(headers: list[Header], units: list[str], line: int) -> tuple[Header, ...]:
    """The headers with the units that the unit row states; raises InvalidError where it has another number of cells."""
    if len(units) < len(headers) or any(units[len(headers) :]):
        raise wrong_line(line, f"must have {len(headers)} cells", "ragged", " ".join(units))
    return tuple(with_unit(header, unit) for header, unit in zip(headers, units, strict=False))
