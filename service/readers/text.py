"""Text of any make -> a table: encoding, separator and titles by what is understood best; then its rows, block by block.

A block of plain rows of numbers is numpy's; one with quotes, comments, dates or missing ends goes through Python's reader of
CSV and `numerals`. Errors name line, column and value.
"""

import codecs
import csv
import io
import re
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pydantic_core
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.errors import MAX_ERRORS, MAX_QUOTED, FieldError, InvalidError, Notice, TooLargeError
from service.readers.clocks import stated_clock
from service.readers.column_names import choices_of, is_counter, recognised
from service.readers.detect import ByteSource, Format, overdue, too_slow
from service.readers.grid import (
    MAX_ROWS,
    Layout,
    find_table,
    is_footer,
    left_out,
    no_table,
    refuse_factors,
    turned,
    was_turned,
)
from service.readers.limits import LIMITS, LONGEST_LINE_BYTES, Limits
from service.readers.numerals import Numerals, is_stamp
from service.readers.table import Column, Reading, Table, labels

#: Bytes of the first block, which must hold the titles, and of each block after it.
_FIRST_BLOCK, _BLOCK = 1 << 17, 1 << 18
_COMMENTS = ("#", "%", "//")
_NEWLINE, _COMMA = b"\n,"
#: Encodings that are tried where text is not UTF-8; of those that read as many titles the first.
_ENCODINGS = ("cp1252", "cp1250", "cp1254", "gb18030", "shift_jis", "euc_jp", "big5", "euc_kr", "cp1251")
#: Pairs of bytes as Chinese text has them, and single ones as Western text has them.
_CHINESE = re.compile(rb"(?:[\x00-\x7f]|[\xa1-\xf7][\xa1-\xfe])*")
#: Cells of which the last is in quotes and goes on; a quotation mark within a cell is no other (3/4").
_OPEN = re.compile(r'(?:(?:[ \t]*"(?:[^"]|"")*+"[^;,\t|\n]*|(?![ \t]*")[^;,\t|\n]*)[;,\t|\n])*+[ \t]*"(?:[^"]|"")*+')
#: Lines that one cell in quotes may go over, in the rows of titles.
_MAX_CELL_LINES = 5

#: Opens the file's bytes from their beginning.
Open = Callable[[], AbstractContextManager[ByteSource]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """How the text is written: encoding, separator (" ": any number of blanks), the table, the lines that are no data."""

    encoding: str
    separator: str
    layout: Layout
    lines: list[str]
    #: The index in `lines`, and the line, of each row that was looked at.
    at: list[int]

    @property
    def first_line(self) -> int:
        """The line of the first row of data, from 1."""
        return self.at[self.layout.start] + 1 if self.layout.start < len(self.at) else len(self.lines) + 1


def read_text(opened: Open, reading: Reading, limits: Limits) -> Table:
    """The table of a text. Raises InvalidError where it has no titles, or its lines are no text."""
    with opened() as source:
        first = next(_raw_blocks(source), b"")
    if len(first) == _FIRST_BLOCK and b"\n" in first and b"\0" not in first:
        first = first[: first.rindex(b"\n") + 1]
    if not first.strip():
        raise wrong_line(1, "is empty, and no header came after it", "no_header")
    try:
        form = _form(first, reading, limits)
    except InvalidError:
        if len(first) == _FIRST_BLOCK or (on_its_side := _turned(first, reading)) is None:
            raise
        table = read_text(lambda: nullcontext(io.BytesIO(on_its_side)), reading, limits)
        return replace(table, notices=[*table.notices, was_turned()])
    body = _Body(opened, form, reading, limits)
    cells = tuple(tuple(_cells(line, form.separator)) for line in form.lines[: form.first_line + 19])
    refuse_factors(cells[: form.first_line - 1])
    return Table(
        columns=tuple(_with_clocks(form.layout.columns(), cells[: form.first_line - 1], body)),
        read=body.read,
        above=cells[: form.at[form.layout.titles]],
        first_line=form.first_line,
        head=cells[form.first_line - 1 :],
        line_of=body.line_of,
        breaks=body.breaks,
        notices=body.notices,
    )


def _with_clocks(columns: Sequence[Column], above: Sequence[Sequence[str]], body: "_Body") -> Iterator[Column]:
    """Columns with the clock that the lines above them state, each with its own where a line has as many cells.

    LabVIEW's column of times may be empty: then it is none.
    """
    for place, column in enumerate(columns):
        if is_counter(column) and body.first[place : place + 1] == [""]:
            yield Column("", title=column.title)
        else:
            own = [row for row in above if len(row) > place and row[place]]
            beside = [(row[0], row[place]) if place and row in own else row for row in above]
            stated = labels([*beside, *((row[place],) for row in own)])
            yield replace(column, clock=stated_clock(stated, body.rows))


# --- bytes -> lines ---


def _raw_blocks(source: ByteSource) -> Iterator[bytes]:
    block = source.read(_FIRST_BLOCK)
    while block:
        yield block
        block = source.read(_BLOCK)


def _blocks(source: ByteSource, encoding: str) -> Iterator[str]:
    """A file's text in blocks of whole lines that all end in a line feed; a cell in quotes is not cut.

    Raises InvalidError on a line that is too long and on text that is not in its encoding.
    """
    decoder = codecs.getincrementaldecoder("utf-8-sig" if encoding == "utf-8" else encoding)()
    lines = io.IncrementalNewlineDecoder(decoder, translate=True)
    rest, line = "", 1
    for block, last in _with_last(_raw_blocks(source)):
        try:
            text = rest + lines.decode(block, last)
        except UnicodeError:
            rule = f"or a line soon after it is not {encoding.upper()}, as the file's beginning says: save it as UTF-8"
            raise wrong_line(line, rule, "not_text") from None
        end = text.rfind("\n") + 1
        if not last and _is_open(text[:end]):
            end = text.rfind("\n", 0, text.rfind('"', 0, end)) + 1
        if len(text) - end > LONGEST_LINE_BYTES + _BLOCK * ('"' in text[end:]):
            rule = f"must not be longer than {LONGEST_LINE_BYTES} bytes"
            raise wrong_line(line + text.count("\n", 0, end), rule, "line_too_long", text[end : end + MAX_QUOTED])
        if last:
            text += "" if end == len(text) else "\n"
            end = len(text)
        whole, rest = text[:end], text[end:]
        if (nul := whole.find("\0")) >= 0:
            raise wrong_line(line + whole.count("\n", 0, nul), "must be text, got a NUL byte", "not_text")
        if whole:
            yield whole
        line += whole.count("\n")


def _with_last(items: Iterator[Any]) -> Iterator[tuple[Any, bool]]:
    """Each item, and whether it is the last."""
    for item in items:
        for following in items:
            yield item, False
            item = following
        yield item, True


def _encodings(head: bytes) -> list[str]:
    """The encodings that a text may be in, likeliest first."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return ["utf-16"]
    sample = head[:512]
    half = len(sample) // 2
    for name, zeros, others in (("utf-16-le", sample[1::2], sample[::2]), ("utf-16-be", sample[::2], sample[1::2])):
        if half and zeros.count(0) > 0.9 * half and others.count(0) == 0:
            return [name]
    if _decodes(head, "utf-8"):
        return ["utf-8"]
    encodings = [name for name in _ENCODINGS if _decodes(head, name)] or ["latin-1"]
    return sorted(encodings, key=lambda name: name != "gb18030") if _CHINESE.fullmatch(head) else encodings


def _decodes(head: bytes, encoding: str) -> bool:
    try:
        codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeError:
        return False
    return True


# --- lines -> the table ---


def _form(first: bytes, reading: Reading, limits: Limits) -> _Form:
    """The encoding, the separator and the table by which most titles are known."""
    best: _Form | None = None
    text: list[str] = []
    for encoding in _encodings(first):
        text = "".join(_blocks(io.BytesIO(first), encoding)).split("\n")[:-1]
        for separator in _separators(text, reading.skip_rows):
            form = _with_separator(encoding, separator, text, reading)
            if form is not None and (best is None or form.layout.score > best.layout.score):
                best = form
        if best is not None and encoding.startswith("utf"):
            break
    if best is None:
        separator = _separators(text, reading.skip_rows)[0]
        raise no_table([_cells(line, separator) for line in text[:MAX_ROWS]], _named(reading))
    if len(best.layout.headings) > limits.most_columns:
        rule = f"must not have more than {limits.most_columns} columns, got {len(best.layout.headings)}"
        raise wrong_line(best.first_line, rule, "too_wide")
    return best


def _turned(first: bytes, reading: Reading) -> bytes | None:
    """A whole text whose lines are channels with its lines as columns, by the separator by which it is a table then."""
    text = "".join(_blocks(io.BytesIO(first), _encodings(first)[0])).split("\n")[reading.skip_rows : -1]
    for separator in _separators(text, 0):
        if on_its_side := turned([_cells(line, separator) for line in text if line.strip()], _named(reading)):
            return "\n".join("\t".join(row) for row in on_its_side[0]).encode()
    return None


def _separators(lines: Sequence[str], skipped: int) -> list[str]:
    """The separators that are tried: the one that the text names, or all that it holds."""
    for line in lines[skipped : skipped + MAX_ROWS]:
        if re.fullmatch(r"sep=.?", line.strip(), re.IGNORECASE):
            return [line.strip()[4:] or "\t"]
    held = [separator for separator in "\t;,|" if any(separator in line for line in lines[:MAX_ROWS])]
    return [*held, "  ", " "] if any(" " in line.strip() for line in lines[:MAX_ROWS]) else held or [","]


def _with_separator(encoding: str, separator: str, lines: list[str], reading: Reading) -> _Form | None:
    rows: list[list[str]] = []
    at: list[int] = []
    comments = set()
    numbered = enumerate(lines[: reading.skip_rows + MAX_ROWS])
    for index, line in numbered:
        if index < reading.skip_rows or re.fullmatch(r"sep=.?", line.strip(), re.IGNORECASE):
            continue
        whole, begun = line, index
        while separator.strip() and _is_open(whole) and index - begun < _MAX_CELL_LINES:
            following = next(numbered, None)
            if following is None:
                break
            index, whole = following[0], whole + "\n" + following[1]
        if is_comment(whole, separator):
            comments.add(len(rows))
            whole = whole.lstrip('#%/;" \t').rstrip('"')
        rows.append(_cells(whole, separator))
        at.append(begun)
    layout = find_table(rows, frozenset(comments), _named(reading))
    if layout is None:
        return None
    return _Form(encoding=encoding, separator=separator, layout=layout, lines=lines, at=at)


def _named(reading: Reading) -> list[str]:
    """The titles that the caller names."""
    return [choice.column for choice in choices_of(reading).values()]


def is_comment(line: str, separator: str) -> bool:
    """Whether a line is a comment; a semicolon begins one where it does not separate."""
    if line[:1].isdigit():
        return False
    bare = line.lstrip().lstrip('"')
    return bare.startswith(_COMMENTS) or (bare.startswith(";") and separator != ";")


def _is_open(text: str) -> bool:
    """Whether a text ends within a cell in quotes."""
    return text.count('"') % 2 == 1 and _OPEN.fullmatch(text) is not None


def _cells(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes, without blanks around them."""
    if not separator.strip(" "):
        apart = r"\s{2,}|\t" if len(separator) > 1 else r"(?<!/)[ \t]+(?![\[({/])"
        cells = re.split(apart, line.strip(), maxsplit=LIMITS.most_columns)  # one more cell is one too many
        return [cell[1:-1] if re.fullmatch(r'"[^"]*"', cell) else cell for cell in cells] if '"' in line else cells
    if '"' in line:
        even = line.replace("\r", " ").split("\n")  # a carriage return within a line is a blank, not a second line
        try:
            read = next(csv.reader([text + "\n" for text in even], delimiter=separator, skipinitialspace=True), [])
        except csv.Error:
            return [line]
        return [" ".join(cell.split()) for cell in read]
    return [cell.strip() for cell in line.split(separator)]


def wrong_line(line: int, rule: str, code: str, got: str = "") -> InvalidError:
    """The error of a line that cannot be part of a table; `line` counts from 1."""
    shown = got[:MAX_QUOTED]
    message = f"line {line} {rule}" + (f", got {shown!r}" if got else "")
    return InvalidError.of(message, code=code, value=shown)


# --- the rows of data ---


class _Body:
    """The rows of data, block by block: columns of text into columns of numbers."""

    def __init__(self, opened: Open, form: _Form, reading: Reading, limits: Limits) -> None:
        self._opened, self._form, self._limits = opened, form, limits
        self._separator = form.separator.strip(" ") or None
        self._titles = form.lines[form.at[form.layout.titles]].strip()
        self._above = {line.strip() for line in form.lines[: form.first_line - 1]}
        self.first = (
            _cells(form.lines[form.first_line - 1], form.separator) if form.first_line <= len(form.lines) else []
        )
        named = len(form.layout.headings)
        self._width = named if any(self.first[named:]) else max(named, len(self.first))
        self._numerals = Numerals(reading)
        #: Of each block its first row, and the lines of its rows from 1; the line that comes next.
        self._lines: list[tuple[int, Sequence[int]]] = []
        self._line = form.first_line
        self._rows = 0
        self.breaks: list[int] = []
        self.notices: list[Notice] = []
        if labelled := form.layout.labelled:
            first = form.lines[form.at[form.layout.start - labelled]]
            self.notices.append(left_out(labelled, "above the first row of", first))

    def rows(self) -> int:
        """How many rows were read."""
        return self._rows

    def line_of(self, row: int) -> int:
        """The line of a row that was read: rows count from 0, lines from 1."""
        first, lines = self._lines[bisect_right(self._lines, row, key=lambda block: block[0]) - 1]
        return lines[row - first]

    def read(self, channels: Mapping[int, str]) -> list[NDArray[Any]]:
        """The columns [n] by index. Raises InvalidError naming line and value, TooLargeError past the limits."""
        self._settle(channels)
        dated = any(name == "time_s" and is_stamp("".join(self.first[at : at + 1])) for at, name in channels.items())
        parts: list[list[NDArray[Any]]] = [[] for _ in channels]
        most = self._limits.most_values // len(channels)
        end, late = time.thread_time() + self._limits.seconds, time.monotonic() + self._limits.wall_seconds
        with self._opened() as source:
            for block, last in _with_last(self._blocks(source)):
                if time.thread_time() > end:
                    raise too_slow(Format.TEXT, self._limits)
                if time.monotonic() > late:
                    raise overdue(Format.TEXT, self._limits)
                text = self._without_footer(block) if last else block
                self._lines.append((self._rows, range(self._line, self._line + text.count("\n"))))
                numbers = None if dated else self._plain(text)
                if numbers is None:
                    columns = self._even(text, channels) or self._careful(text, channels)
                else:
                    columns = [numbers[:, index].copy() for index in channels]
                self._line += block.count("\n")
                for part, column in zip(parts, columns, strict=True):
                    part.append(column)
                self._rows += columns[0].size
                if self._rows > most:
                    raise TooLargeError(f"a file of {len(channels)} channels must not have more than {most} rows")
        joined = []
        while parts:
            part = parts.pop(0) or [np.empty(0)]
            masked = any(isinstance(values, np.ma.MaskedArray) for values in part)
            joined.append((np.ma.concatenate if masked else np.concatenate)(part))
        return joined

    def _blocks(self, source: ByteSource) -> Iterator[str]:
        """The blocks from the first row of data on."""
        above = self._form.first_line - 1
        for block in _blocks(source, self._form.encoding):
            start = 0
            while above and start < len(block):
                start = block.index("\n", start) + 1
                above -= 1
            if start < len(block):
                yield block[start:]

    def _settle(self, channels: Mapping[int, str]) -> None:
        """Learn the decimal sign from the first cell that can be read in one way; a full stop where no cell has a sign."""
        doubtful = False
        with self._opened() as source:
            for block in self._blocks(source):
                if self._numerals.decimal:
                    return
                if "." in block or ("," in block and (self._separator != "," or '"' in block)):
                    rows = [row for _, _, row in self._parsed(block) if len(row) > max(channels)]
                    doubtful |= self._numerals.settle(
                        [[row[index] for row in rows] for index, name in channels.items() if name]
                    )
        self._numerals.decimal = self._numerals.decimal or ("" if doubtful else ".")

    def _plain(self, block: str) -> FloatArray | None:
        """A block of nothing but numbers [rows, columns], by jiter (pydantic-core's reader of JSON); None for any other."""
        separator, decimal = self._separator, self._numerals.decimal
        if not decimal or separator is None or (separator != "," and decimal == "." and "," in block):
            return None
        if decimal == ",":
            block = "" if "." in block else block.replace(",", ".")
        plain = block.replace(separator, ",").encode()
        if not plain or plain.translate(None, b"0123456789.eE+-,\n"):
            return None
        letters = np.frombuffer(plain, np.uint8)
        ends_line = (letters == _NEWLINE)[(letters == _NEWLINE) | (letters == _COMMA)]
        if ends_line.size != self._width * plain.count(b"\n") or not ends_line[self._width - 1 :: self._width].all():
            return None  # not as many cells in each line
        try:
            cells = pydantic_core.from_json(b"[%b]" % plain[:-1].replace(b"\n", b","))
            return np.array(cells, dtype=np.float64).reshape(-1, self._width)
        except (ValueError, OverflowError):
            return None

    def _even(self, block: str, channels: Mapping[int, str]) -> list[NDArray[Any]] | None:
        """The columns of a block of rows of as many cells, none in quotes; None for any other, and where a cell is wrong."""
        if '"' in block or any(f"\n{mark}" in "\n" + block for mark in _COMMENTS):
            return None
        separator, width, rows = self._separator or " ", self._width, block.count("\n")
        if separator == " ":
            block = re.sub(r" ?\n ?", "\n", re.sub(r"[ \t]+", " ", block)).lstrip(" ")
        cells = block.replace("\n", f"{separator}\n{separator}").split(separator)
        if len(cells) != (width + 1) * rows + 1 or cells[width :: width + 1].count("\n") != rows:
            return None
        columns = [cells[index : -1 : width + 1] for index in channels]
        try:
            return self._numerals.values(channels, columns, self.line_of, self._rows)
        except InvalidError:
            return None

    def _parsed(self, block: str) -> Iterator[tuple[str, int, list[str]]]:
        """Rows: the line that each begins with, how many it takes, and its cells."""
        lines, at = block.split("\n")[:-1], 0
        if self._separator is None or '"' not in block:
            for line in lines:
                cells = line.split(self._separator) if self._separator else _cells(line, " ")
                # titles may be two blanks apart and cells one, or two where one is within a cell
                even = self._separator or len(cells) == self._width
                yield line, 1, cells if even else _cells(line, self._form.separator)
            return
        reader = csv.reader([f"{line}\n" for line in lines], delimiter=self._separator, skipinitialspace=True)
        try:
            for row in reader:
                yield lines[at], reader.line_num - at, row
                at = reader.line_num
        except csv.Error:
            raise wrong_line(self._line + at, "begins a quotation that does not end", "ragged") from None

    def _careful(self, block: str, channels: Mapping[int, str]) -> list[NDArray[Any]]:
        """The columns of any other block, without comments, blank lines and repeated titles.

        Raises InvalidError with every line of it that has too few or too many cells, or cells that are no numbers.
        """
        rows: list[list[str]] = []
        lines: list[int] = []
        separator, line_number = self._form.separator, self._line
        for line, taken, cells in self._parsed(block):
            bare = line.strip()
            if bare and bare not in self._above and not is_comment(bare, separator) and bare.strip(separator):
                rows.append(cells)
                lines.append(line_number)
            elif bare == self._titles and self._rows + len(rows):
                while rows and is_footer(rows[-1], self.first):
                    rows.pop(), lines.pop()  # lines above the titles of a further table
                self.breaks.append(self._rows + len(rows))
            line_number += taken
        self._lines[-1] = self._rows, lines
        errors = []
        for row, cells in enumerate(rows):
            if len(cells) != self._width and not self._fit(cells, channels):
                errors.append(self._ragged(self._rows + row, cells))
        if errors:
            more = (
                ""
                if len(errors) == 1
                else f"; {len(errors)} errors up to line {self.line_of(self._rows + len(rows) - 1)}"
            )
            raise InvalidError(errors[0].message + more, errors=errors[:MAX_ERRORS], total=len(errors))
        columns = [[cells[index] for cells in rows] for index in channels]
        return self._numerals.values(channels, columns, self.line_of, self._rows)

    def _fit(self, cells: list[str], channels: Mapping[int, str]) -> bool:
        """Whether a row is one with empty cells at its end, or none of those that are not taken; they are added."""
        while len(cells) > self._width and not cells[-1].strip():
            cells.pop()
        if len(cells) > max(channels):
            cells += [""] * (self._width - len(cells))
        return len(cells) == self._width

    def _ragged(self, row: int, cells: Sequence[str]) -> FieldError:
        line = (self._separator or " ").join(cells)[:MAX_QUOTED]
        message = f"line {self.line_of(row)} must have {self._width} cells, got {len(cells)}: {line!r}"
        if recognised(cells, ()) > 1:
            message += ": another table begins there, send it in a file of its own"
        return FieldError(pointer="", row=row + 1, value=line, code="ragged", message=message)

    def _without_footer(self, block: str) -> str:
        """The last block without what stands below the table: words, and rows that a word begins (`Mean;5;100;20`)."""
        lines = block.split("\n")[:-1]
        kept = end = len(lines)
        while end:
            cells = _cells(lines[end - 1], self._form.separator)
            footer = is_footer(cells, self.first)
            if not footer and any(cells):
                break
            end -= 1
            if footer and not is_comment(lines[end], self._form.separator):
                kept = end
        if kept < len(lines):
            self.notices.append(left_out(len(lines) - kept, "below", lines[kept]))
        return "".join(f"{line}\n" for line in lines[:kept])
