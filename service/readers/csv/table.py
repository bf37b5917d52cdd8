"""The data rows of a CSV file -> columns: whole blocks by `decimals`, cell by cell where a block is not that plain.

A block that `decimals` refuses is made plain first (`cells`): comments and blank lines skipped, quotes and columns that are
not taken left out. What it refuses then is read cell by cell, and errors name line, column and value. So files of millions
of rows are fast, tidy or not; a file that takes longer than the limit is refused.
"""

import csv
import time
from array import array
from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from models.arrays import FloatArray
from service.errors import MOST_ERRORS, MOST_QUOTED, FieldError, InvalidError, TooLargeError
from service.readers.column_names import Taken
from service.readers.csv.cells import INNER, picked, without_comments
from service.readers.csv.decimals import NUMBER, parse_rows
from service.readers.csv.header_rows import Layout
from service.readers.csv.lines import cells_of, text_of
from service.readers.limits import Limits

#: How often padding is taken off a block: as many blanks as a tidy file has.
_MOST_PASSES = 16


@dataclass(slots=True)
class _LineNumbers:
    """The line of each row: rows begin on line `first`; skipped lines (comments, blank lines) are counted in."""

    first: int
    rows: "array[int]" = field(default_factory=lambda: array("q"))
    skipped: "array[int]" = field(default_factory=lambda: array("q"))

    def skip(self, row: int) -> None:
        """Count a line before row `row` that is no row."""
        total = (self.skipped[-1] if self.skipped else 0) + 1
        if self.rows and self.rows[-1] == row:
            self.skipped[-1] = total
        else:
            self.rows.append(row)
            self.skipped.append(total)

    def of(self, row: int) -> int:
        """The line of a row: rows count from 0, lines from 1."""
        before = bisect_right(self.rows, row)
        return self.first + row + (self.skipped[before - 1] if before else 0)


class _GrowingColumns:
    """Columns that rows are added to; they grow in place, by a third."""

    def __init__(self, columns: int, limits: Limits) -> None:
        self._columns = [np.empty(0) for _ in range(columns)]
        self._most = limits.most_values // columns
        self.rows = 0

    def add(self, rows: FloatArray) -> None:
        """Add rows [k, columns]. Raises TooLargeError past the limit."""
        end = self.rows + len(rows)
        if end > self._most:
            raise TooLargeError(f"a file of {len(self._columns)} channels must not have more than {self._most} rows")
        for index, column in enumerate(self._columns):
            if end > column.size:
                column.resize(end + end // 3, refcheck=False)
            column[self.rows : end] = rows[:, index]
        self.rows = end

    def columns(self) -> list[FloatArray]:
        """The columns [rows], cut to their length; no row can be added afterwards."""
        for column in self._columns:
            column.resize(self.rows, refcheck=False)
        return self._columns


class Table:
    """The data rows of a file, added block by block."""

    def __init__(self, layout: Layout, taken: list[Taken], limits: Limits) -> None:
        self._layout = layout
        self._taken = taken
        self._indices = [column.index for column in taken]
        self._growing = _GrowingColumns(len(taken), limits)
        self._decimal = ""
        self._seconds = limits.seconds
        self._end = time.monotonic() + limits.seconds
        self.lines = _LineNumbers(layout.line)

    def add(self, block: bytes) -> None:
        """The next block of whole lines. Raises InvalidError where reading has taken too long."""
        if time.monotonic() > self._end:
            message = f"the CSV file cannot be read: it took longer than {self._seconds} s"
            raise InvalidError(message, errors=[FieldError(pointer="", code="too_slow", message=message)])
        rows = self._read_plain(block)
        self._growing.add(self._read_careful(block) if rows is None else rows[:, self._indices])

    def columns(self) -> dict[str, FloatArray]:
        """The columns in the channels' units."""
        columns = dict(zip((column.channel for column in self._taken), self._growing.columns(), strict=True))
        for column in self._taken:
            column.conversion.apply(columns[column.channel])
        return columns

    def _read_plain(self, block: bytes) -> FloatArray | None:
        """All columns of a block of nothing but numbers, [rows, columns]; None where it holds anything else."""
        separator, width = self._layout.separator.encode(), len(self._layout.headers)
        quotes = block.count(b'"')
        if quotes:
            # With every cell in quotes, none can hold a separator without making its line too long.
            if quotes != 2 * width * block.count(b"\n"):
                return None
            block = block.replace(b'"', b"")
        return self._parse(block, separator, width)

    def _parse(self, block: bytes, separator: bytes, width: int) -> FloatArray | None:
        """Lines of `width` numbers, without the blanks around and the separators after them; None where a line is not so."""
        if b" " in block:
            for space in (b" " + separator, separator + b" ", b" \n", b"\n "):
                block = _without(block, space, space.strip(b" "))
            block = block.lstrip(b" ")
        block = _without(block, separator + b"\n", b"\n")
        decimal = self._decimal
        if separator != b"," and b"," in block:
            decimal = ","
            if b"." in block:
                return None
            block = block.replace(b",", b".")
        elif b"." in block:
            decimal = "."
        if self._decimal and decimal != self._decimal:
            return None
        rows = parse_rows(block, separator[0], width)
        if rows is not None:
            self._decimal = decimal
        return rows

    def _read_careful(self, block: bytes) -> FloatArray:
        """The columns taken of any other block. Raises InvalidError with every line of it that is wrong."""
        separator, width = self._layout.separator.encode(), len(self._layout.headers)
        block, skipped = without_comments(block, self._layout.separator)
        for line in skipped:
            self.lines.skip(self._growing.rows + line)
        tidy = block
        if block.count(separator, 0, block.find(b"\n")) >= width:
            tidy = _without(block, separator + b"\n", b"\n")
        cells = picked(tidy, separator, width, self._indices)
        rows = None if cells is None else self._parse(cells, INNER, len(self._indices))
        return self._read_cells(text_of(block).split("\n")[:-1]) if rows is None else rows

    def _read_cells(self, lines: list[str]) -> FloatArray:
        rows: list[list[float]] = []
        errors: list[FieldError] = []
        wrong = 0
        separator, width = self._layout.separator, len(self._layout.headers)
        for line in lines:
            row = self._growing.rows + len(rows)
            try:
                cells = cells_of(line, separator)
            except csv.Error:
                cells = [line]
            while len(cells) > width and not cells[-1]:
                cells.pop()
            values = [np.nan] * len(self._indices)
            fits = len(cells) == width
            line_errors = self._numbers(row, cells, values) if fits else [self._ragged(row, line, len(cells))]
            rows.append(values)
            wrong += len(line_errors)
            errors += line_errors[: max(0, MOST_ERRORS - len(errors))]
        if errors:
            more = (
                "" if wrong == 1 else f"; {wrong} errors up to line {self.lines.of(self._growing.rows + len(rows) - 1)}"
            )
            raise InvalidError(errors[0].message + more, errors=errors, total=wrong)
        return np.array(rows, dtype=np.float64).reshape(-1, len(self._indices))

    def _ragged(self, row: int, line: str, cells: int) -> FieldError:
        width = len(self._layout.headers)
        message = f"line {self.lines.of(row)} must have {width} cells, got {cells}: {line[:MOST_QUOTED]!r}"
        return FieldError(pointer="", row=row + 1, value=line[:MOST_QUOTED], code="ragged", message=message)

    def _numbers(self, row: int, cells: list[str], values: list[float]) -> list[FieldError]:
        errors = []
        for place, column in enumerate(self._taken):
            cell = cells[column.index]
            plain = cell.replace(",", ".", 1)
            decimal = "," if "," in cell else "." if "." in cell else self._decimal
            if NUMBER.fullmatch(plain) and decimal == (self._decimal or decimal):
                self._decimal = decimal
                values[place] = float(plain)
                continue
            rule = "must be a number"
            if NUMBER.fullmatch(plain):
                rule = f"must have the decimal sign {self._decimal!r} as before"
            errors.append(
                FieldError(
                    pointer=f"/channels/{column.channel}/{row}",
                    row=row + 1,
                    value=cell[:MOST_QUOTED],
                    code="not_a_number",
                    message=f"{column.channel}[{row}] (line {self.lines.of(row)}) {rule}, got {cell[:MOST_QUOTED]!r}",
                )
            )
        return errors


def _without(block: bytes, padding: bytes, replacement: bytes) -> bytes:
    """A block with padding or trailing separators taken off, as many as a tidy file has."""
    for _ in range(_MOST_PASSES):
        if padding not in block:
            break
        block = block.replace(padding, replacement)
    return block
