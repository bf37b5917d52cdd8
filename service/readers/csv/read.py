"""CSV -> columns: whole blocks of digits by `decimals`, and line by line where a block is not so plain.

A block that `decimals` refuses is made plain first (`csv_cells`): comments and blank lines skipped, quotes and columns that
are not taken left out. What it refuses then is read cell by cell, and line, column and value of what is wrong are named. So
files of millions of rows are fast, tidy or not, and all files are told apart; what takes longer than the limit is refused.
"""

import csv
import time
from array import array
from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from models.arrays import FloatArray
from service.errors import MOST_ERRORS, FieldError, InvalidError, TooLargeError
from service.readers.checks import LineOf
from service.readers.column_names import Taken, choose
from service.readers.csv.cells import INNER, picked, without_comments
from service.readers.csv.decimals import NUMBER, parse_rows
from service.readers.csv.head import Layout, blocks, cells_of, read_head, text_of
from service.readers.detect import ByteSource
from service.readers.limits import Limits

_SHOWN = 80
_MOST_PASSES = 16
_KEPT = 1 << 18


@dataclass(slots=True)
class _Lines:
    """Which line a row stands on: `first` and on, with the lines that were skipped on the way."""

    first: int
    rows: "array[int]" = field(default_factory=lambda: array("q"))
    skipped: "array[int]" = field(default_factory=lambda: array("q"))

    def skip(self, row: int) -> None:
        """A line before row `row` is none of the table's."""
        total = (self.skipped[-1] if self.skipped else 0) + 1
        if self.rows and self.rows[-1] == row:
            self.skipped[-1] = total
        else:
            self.rows.append(row)
            self.skipped.append(total)

    def of(self, row: int) -> int:
        """The line of a row, both as they are counted: rows from 0, lines from 1."""
        before = bisect_right(self.rows, row)
        return self.first + row + (self.skipped[before - 1] if before else 0)


class _Growing:
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
        """The columns [rows], and nothing more: this object is done."""
        for column in self._columns:
            column.resize(self.rows, refcheck=False)
        return self._columns


class _Table:
    """The data of a file as they come, block by block."""

    def __init__(self, layout: Layout, taken: list[Taken], limits: Limits) -> None:
        self._layout = layout
        self._taken = taken
        self._at = [each.index for each in taken]
        self._grown = _Growing(len(taken), limits)
        self._decimal = ""
        self._seconds = limits.seconds
        self._end = time.monotonic() + limits.seconds
        self.lines = _Lines(layout.line)

    def add(self, block: bytes) -> None:
        """The next block of whole lines. Raises InvalidError where reading has taken too long."""
        if time.monotonic() > self._end:
            message = f"the CSV file cannot be read: it took longer than {self._seconds} s"
            raise InvalidError(message, errors=[FieldError(pointer="", code="too_slow", message=message)])
        rows = self._plain(block)
        self._grown.add(self._careful(block) if rows is None else rows[:, self._at])

    def columns(self) -> dict[str, FloatArray]:
        """The columns in the channels' units."""
        columns = dict(zip((each.channel for each in self._taken), self._grown.columns(), strict=True))
        for each in self._taken:
            each.conversion.apply(columns[each.channel])
        return columns

    def _plain(self, block: bytes) -> FloatArray | None:
        """All columns of a block of nothing but numbers, [rows, columns]; None where it holds anything else."""
        separator, width = self._layout.separator.encode(), len(self._layout.headers)
        quotes = block.count(b'"')
        if quotes:
            # With every cell in quotes, none can hold a separator without making its line too long.
            if quotes != 2 * width * block.count(b"\n"):
                return None
            block = block.replace(b'"', b"")
        return self._parsed(block, separator, width)

    def _parsed(self, block: bytes, separator: bytes, width: int) -> FloatArray | None:
        """Lines of `width` numbers, blanks around them and separators after them taken off; None where it is not so."""
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

    def _careful(self, block: bytes) -> FloatArray:
        """The columns taken of a block that is not so plain. Raises InvalidError with every line of it that is wrong."""
        separator, width = self._layout.separator.encode(), len(self._layout.headers)
        block, skipped = without_comments(block, self._layout.separator)
        for line in skipped:
            self.lines.skip(self._grown.rows + line)
        tidy = block
        if block.count(separator, 0, block.find(b"\n")) >= width:
            tidy = _without(block, separator + b"\n", b"\n")
        cells = picked(tidy, separator, width, self._at)
        rows = None if cells is None else self._parsed(cells, INNER, len(self._at))
        return self._cell_by_cell(text_of(block).split("\n")[:-1]) if rows is None else rows

    def _cell_by_cell(self, lines: list[str]) -> FloatArray:
        rows: list[list[float]] = []
        errors: list[FieldError] = []
        wrong = 0
        separator, width = self._layout.separator, len(self._layout.headers)
        for line in lines:
            row = self._grown.rows + len(rows)
            try:
                cells = cells_of(line, separator)
            except csv.Error:
                cells = [line]
            while len(cells) > width and not cells[-1]:
                cells.pop()
            values = [np.nan] * len(self._at)
            fits = len(cells) == width
            found = self._numbers(row, cells, values) if fits else [self._ragged(row, line, len(cells))]
            rows.append(values)
            wrong += len(found)
            errors += found[: max(0, MOST_ERRORS - len(errors))]
        if errors:
            more = (
                "" if wrong == 1 else f"; {wrong} errors up to line {self.lines.of(self._grown.rows + len(rows) - 1)}"
            )
            raise InvalidError(errors[0].message + more, errors=errors, total=wrong)
        return np.array(rows, dtype=np.float64).reshape(-1, len(self._at))

    def _ragged(self, row: int, line: str, cells: int) -> FieldError:
        width = len(self._layout.headers)
        message = f"line {self.lines.of(row)} must have {width} cells, got {cells}: {line[:_SHOWN]!r}"
        return FieldError(pointer="", row=row + 1, value=line[:_SHOWN], code="ragged", message=message)

    def _numbers(self, row: int, cells: list[str], values: list[float]) -> list[FieldError]:
        errors = []
        for place, each in enumerate(self._taken):
            cell = cells[each.index]
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
                    pointer=f"/channels/{each.channel}/{row}",
                    row=row + 1,
                    value=cell[:_SHOWN],
                    code="not_a_number",
                    message=f"{each.channel}[{row}] (line {self.lines.of(row)}) {rule}, got {cell[:_SHOWN]!r}",
                )
            )
        return errors


def _without(block: bytes, what: bytes, instead: bytes) -> bytes:
    """A block with padding or trailing separators taken off, as many as a tidy file has."""
    for _ in range(_MOST_PASSES):
        if what not in block:
            break
        block = block.replace(what, instead)
    return block


def read_csv(source: ByteSource, *, mapping: str | None, limits: Limits) -> tuple[dict[str, FloatArray], LineOf]:
    """A CSV file -> its channels in their own units [n], and the line of each row. Memory: the columns and a block.

    Raises InvalidError naming line and value, TooLargeError past the limits.
    """
    # Having freed one array of this size, malloc keeps smaller ones' pages: mapping them anew a block doubles the time.
    np.empty(_KEPT)
    table = None
    for block in blocks(source):
        if table is None:
            layout = read_head(block, limits)
            table = _Table(layout, choose(layout.headers, mapping), limits)
            block = block[layout.start :]
        if block:
            table.add(block)
    if table is None:
        raise InvalidError("the file must not be empty")
    return table.columns(), table.lines.of
