"""Text of any make -> a table: encoding, separator and titles by what is understood best, data rows in blocks.

A block of plain cells is split whole; one with quotes, comments or missing ends goes through Python's reader of CSV. Both
give columns of text, which `numerals` turns into numbers. Errors name line, column and value.
"""

import codecs
import csv
import re
import time
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pydantic_core
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.errors import MOST_ERRORS, MOST_QUOTED, FieldError, InvalidError, TooLargeError
from service.readers.column_names import choices_of
from service.readers.detect import ByteSource
from service.readers.grid import MOST_ROWS, Layout, find_table, no_table
from service.readers.limits import LIMITS, LONGEST_LINE_BYTES, Limits
from service.readers.numerals import Numerals, Stamps, Undecided, doubtful_number
from service.readers.table import Reading, Table

#: Bytes of the first block, which must hold the titles, and of each block after it.
_FIRST_BLOCK, _BLOCK = 1 << 17, 1 << 18
#: Bytes of text that wait for a number which shows the decimal sign. Chosen: a test of plateaus is a thousandth.
_MOST_WAITING = 8 << 20
#: What a block of nothing but numbers is made of.
_BARE = b"0123456789.eE+-,\n"
_NEWLINE, _COMMA = b"\n,"
_COMMENTS = ("#", "%", "//")
#: Encodings that are tried where text is not UTF-8; of those that read as many titles the first.
_ENCODINGS = ("cp1252", "gb18030", "shift_jis", "big5", "euc_kr", "cp1251")
#: Pairs of bytes as Chinese text has them, and single ones as Western text has them.
_CHINESE = re.compile(rb"(?:[\x00-\x7f]|[\xa1-\xf7][\xa1-\xfe])*")

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
    form = _form(first, reading, limits)
    body = _Body(opened, form, reading, limits)
    titles = form.layout.titles
    return Table(
        columns=form.layout.columns(),
        read=body.read,
        above=tuple(tuple(_cells(line, form.separator)) for line in form.lines[: form.at[titles]]),
        first_line=form.first_line,
        head=tuple(tuple(_cells(line, form.separator)) for line in form.lines[form.first_line - 1 :][:20]),
        line_of=body.lines.of,
    )


# --- bytes -> lines ---


def _raw_blocks(source: ByteSource) -> Iterator[bytes]:
    block = source.read(_FIRST_BLOCK)
    while block:
        yield block
        block = source.read(_BLOCK)


def _blocks(source: ByteSource, encoding: str) -> Iterator[bytes]:
    """A file's text in UTF-8, in blocks of whole lines that all end in a line feed; a cell in quotes is not cut.

    Raises InvalidError on a line that is too long and on text that is not in its encoding.
    """
    decoder = None if encoding == "utf-8" else codecs.getincrementaldecoder(encoding)()
    rest, line, returns_alone = b"", 1, False
    raw = _raw_blocks(source)
    block: bytes | None = next(raw, None)
    block = None if block is None else block.removeprefix(codecs.BOM_UTF8)
    while block is not None or rest:
        last = block is None
        text = (block or b"") if decoder is None else _decoded(decoder, block or b"", last, line, encoding)
        if line == 1 and not rest:
            returns_alone = b"\r" in text and b"\n" not in text
        if returns_alone:
            text = text.replace(b"\r", b"\n")
        text = rest + text + (b"\n" if last else b"")
        end = text.rfind(b"\n") + 1
        if not last and text.count(b'"', 0, end) % 2:
            end = text.rfind(b"\n", 0, text.rfind(b'"', 0, end)) + 1
        if len(text) - end > LONGEST_LINE_BYTES + _BLOCK * (b'"' in text[end:]):
            rule = f"must not be longer than {LONGEST_LINE_BYTES} bytes"
            raise wrong_line(
                line + text.count(b"\n", 0, end), rule, "line_too_long", _text(text[end : end + MOST_QUOTED])
            )
        whole, rest = text[:end].replace(b"\r\n", b"\n"), text[end:]
        if (nul := whole.find(b"\0")) >= 0:
            raise wrong_line(line + whole.count(b"\n", 0, nul), "must be text, got a NUL byte", "not_text")
        if whole:
            yield whole
        line += whole.count(b"\n")
        block = None if last else next(raw, None)


def _decoded(decoder: codecs.IncrementalDecoder, block: bytes, last: bool, line: int, encoding: str) -> bytes:
    try:
        return decoder.decode(block, last).encode("utf-8")
    except UnicodeError:
        rule = f"or a line soon after it is not {encoding.upper()}, as the file's beginning says: save it as UTF-8"
        raise wrong_line(line, rule, "not_text") from None


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
        text = _text(b"".join(_blocks(_Head(first), encoding))).split("\n")[:-1]
        for separator in _separators(text, reading.skip_rows):
            form = _with_separator(encoding, separator, text, reading)
            if form is not None and (best is None or form.layout.score > best.layout.score):
                best = form
        if best is not None and encoding.startswith("utf"):
            break
    if best is None:
        line = next((index for index, row in enumerate(text) if row.strip()), 0)
        raise no_table(line + 1, text[line] if text else "")
    if len(best.layout.headings) > limits.most_columns:
        rule = f"must not have more than {limits.most_columns} columns, got {len(best.layout.headings)}"
        raise wrong_line(best.first_line, rule, "too_wide")
    return best


class _Head:
    """The first block as a source of its own."""

    def __init__(self, head: bytes) -> None:
        self._head = head

    def read(self, _: int, /) -> bytes:
        head, self._head = self._head, b""
        return head


def _separators(lines: Sequence[str], skipped: int) -> list[str]:
    """The separators that are tried: the one that the text names, or all that it holds."""
    for line in lines[skipped : skipped + MOST_ROWS]:
        if re.fullmatch(r"sep=.?", line.strip(), re.IGNORECASE):
            return [line.strip()[4:] or "\t"]
    held = [separator for separator in "\t;,|" if any(separator in line for line in lines[:MOST_ROWS])]
    return [*held, "  ", " "] if any(" " in line.strip() for line in lines[:MOST_ROWS]) else held or [","]


def _with_separator(encoding: str, separator: str, lines: list[str], reading: Reading) -> _Form | None:
    rows: list[list[str]] = []
    at: list[int] = []
    comments = set()
    numbered = enumerate(lines[: reading.skip_rows + MOST_ROWS])
    for index, line in numbered:
        if index < reading.skip_rows or re.fullmatch(r"sep=.?", line.strip(), re.IGNORECASE):
            continue
        whole, begun = line, index
        while whole.count('"') % 2 and separator.strip() and index - begun < _MOST_CELL_LINES:
            following = next(numbered, None)
            if following is None:
                break
            index, whole = following[0], whole + "\n" + following[1]
        if is_comment(whole, separator):
            comments.add(len(rows))
            whole = whole.lstrip('#%/;" \t').rstrip('"')
        rows.append(_cells(whole, separator))
        at.append(begun)
    layout = find_table(rows, frozenset(comments), [choice.column for choice in choices_of(reading).values()])
    if layout is None:
        return None
    return _Form(encoding=encoding, separator=separator, layout=layout, lines=lines, at=at)


#: Lines that one cell in quotes may go over, in the rows of titles.
_MOST_CELL_LINES = 5


def _text(block: bytes) -> str:
    return block.decode("utf-8", "replace")


def is_comment(line: str, separator: str) -> bool:
    """Whether a line is a comment; a semicolon begins one where it does not separate."""
    bare = line.lstrip().lstrip('"')
    return bare.startswith(_COMMENTS) or (bare.startswith(";") and separator != ";")


def _cells(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes, without blanks around them."""
    if not separator.strip(" "):
        apart = r"\s{2,}|\t" if len(separator) > 1 else r"(?<!/)[ \t]+(?![\[({/])"
        return re.split(apart, line.strip(), maxsplit=LIMITS.most_columns)  # one more cell is one too many
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
    shown = got[:MOST_QUOTED]
    message = f"line {line} {rule}" + (f", got {shown!r}" if got else "")
    return InvalidError(message, errors=[FieldError(pointer="", code=code, message=message, value=shown)])


# --- the rows of data ---


class _Lines:
    """The line of each row: rows begin on line `first`; lines that are no rows are counted in where they stand."""

    def __init__(self, first: int) -> None:
        self._first = first
        self._rows: array[int] = array("q")

    def skip(self, row: int, lines: int = 1) -> None:
        """Count lines before row `row` that are no rows."""
        self._rows.extend([row] * lines)

    def of(self, row: int) -> int:
        """The line of a row: rows count from 0, lines from 1."""
        return self._first + row + bisect_right(self._rows, row)


@dataclass(slots=True)
class _Block:
    """A block of rows: its text, the columns taken as text, and whether comments and repeated titles were looked for."""

    text: bytes
    columns: list[bytes]
    careful: bool


class _Body:
    """The rows of data: block by block, columns of text into columns of numbers."""

    def __init__(self, opened: Open, form: _Form, reading: Reading, limits: Limits) -> None:
        self._opened, self._form, self._limits = opened, form, limits
        self._width = len(form.layout.headings)
        self._numerals = Numerals(reading.decimal)
        self._stamps: dict[int, Stamps] = {}
        self._indices: Sequence[int] = ()
        self._channels: Mapping[int, str] = {}
        self._rows = 0
        self.lines = _Lines(form.first_line)

    def read(self, channels: Mapping[int, str]) -> list[NDArray[Any]]:
        """The columns [n] by index. Raises InvalidError naming line and value, TooLargeError past the limits."""
        self._channels, indices = channels, list(channels)
        self._indices = indices
        columns = [np.empty(0) for _ in indices]
        waiting: list[_Block] = []
        size, end = 0, time.monotonic() + self._limits.seconds
        with self._opened() as source:
            for text in self._data_blocks(source):
                if time.monotonic() > end:
                    message = f"the CSV file cannot be read: it took longer than {self._limits.seconds} s"
                    raise InvalidError(message, errors=[FieldError(pointer="", code="too_slow", message=message)])
                if not waiting and (rows := self._bare(text)) is not None:
                    self._add(columns, [rows[:, index] for index in indices])
                    continue
                plain = self._plain(text)
                block = _Block(text, plain or self._careful(text), careful=plain is None)
                if not block.columns:
                    continue
                waiting.append(block)
                try:
                    self._numerals.settle(block.columns)
                except Undecided:
                    size += len(text)
                    if size > _MOST_WAITING:
                        break
                    continue
                for block in waiting:
                    self._add(columns, self._numbers(block))
                waiting, size = [], 0
        for block in waiting:
            self._refuse_doubt(block)
        for index, column in enumerate(columns):
            column.resize(self._rows, refcheck=False)
            if indices[index] in self._stamps:
                columns[index] = (column * 1e9).astype("timedelta64[ns]")
        return columns

    def _add(self, columns: list[FloatArray], numbers: list[FloatArray]) -> None:
        """Add rows to columns that grow in place, by a third. Raises TooLargeError past the limit."""
        end = self._rows + (numbers[0].size if numbers else 0)
        most = self._limits.most_values // max(len(columns), 1)
        if end > most:
            raise TooLargeError(f"a file of {len(columns)} channels must not have more than {most} rows")
        for column, added in zip(columns, numbers, strict=True):
            if end > column.size:
                column.resize(end + end // 3, refcheck=False)
            column[self._rows : end] = added
        self._rows = end

    def _data_blocks(self, source: ByteSource) -> Iterator[bytes]:
        """The blocks from the first row of data on."""
        above = self._form.first_line - 1
        for block in _blocks(source, self._form.encoding):
            start = 0
            while above and start < len(block):
                start = block.index(b"\n", start) + 1
                above -= 1
            if start < len(block):
                yield block[start:]

    def _bare(self, block: bytes) -> FloatArray | None:
        """A block of nothing but numbers, once the decimal sign is known, [rows, columns]; None for any other block."""
        separator, decimal = self._form.separator.encode(), self._numerals.decimal
        if not decimal or self._stamps or not separator.strip(b" "):
            return None
        if decimal == b",":
            block = b"" if b"." in block else block.replace(b",", b".")
        elif separator != b"," and b"," in block:
            return None
        block = block.replace(separator, b",")
        if not block or block.translate(None, _BARE):
            return None
        letters = np.frombuffer(block, np.uint8)
        ends_line = (letters == _NEWLINE)[(letters == _NEWLINE) | (letters == _COMMA)]
        if ends_line.size != self._width * block.count(b"\n") or not ends_line[self._width - 1 :: self._width].all():
            return None  # not as many cells in each line
        try:
            numbers = np.array(pydantic_core.from_json(b"[%b]" % block[:-1].replace(b"\n", b",")), dtype=np.float64)
        except (ValueError, OverflowError):
            return None
        return numbers.reshape(-1, self._width)

    def _plain(self, block: bytes) -> list[bytes] | None:
        """The columns of a block of nothing but rows of as many cells, apart by line feeds; None for any other block."""
        separator, width = self._form.separator.encode(), self._width
        if not separator.strip(b" "):
            block = re.sub(rb" ?\n ?", b"\n", re.sub(rb"[ \t]+", b" ", block)).lstrip(b" ")
            separator = b" "
        if block[:1] in (b"#", b"%", b"/") or any(mark in block for mark in (b"\n#", b"\n%", b"\n/")):
            return None
        if b'"' in block:
            return self._quoted(block)
        closing = separator + b"\n"
        for _ in range(_MOST_CLOSING):
            if closing not in block or block.count(separator, 0, block.index(b"\n")) < width:
                break
            block = block.replace(closing, b"\n")
        rows = block.count(b"\n")
        cells = block.replace(b"\n", separator + b"\n" + separator).split(separator)
        if len(cells) != (width + 1) * rows + 1 or cells[width :: width + 1].count(b"\n") != rows:
            return None
        return [b"\n".join(cells[index : -1 : width + 1]) for index in self._indices]

    def _quoted(self, block: bytes) -> list[bytes] | None:
        """The same of rows with quotes, by Python's reader of CSV."""
        try:
            lines = _text(block).replace("\r", " ").split("\n")[:-1]
            rows = list(csv.reader(lines, delimiter=self._form.separator, skipinitialspace=True, strict=True))
        except csv.Error:
            return None
        if len(rows) != len(lines) or set(map(len, rows)) != {self._width}:
            return None
        columns = list(zip(*rows, strict=True))
        return ["\n".join(columns[index]).encode() for index in self._indices]

    def _careful(self, block: bytes) -> list[bytes]:
        """The columns of any other block, without comments, blank lines and repeated titles; none where no row is left.

        Raises InvalidError with every line of it that has too few or too many cells.
        """
        separator = self._form.separator
        repeated = {line.strip() for line in self._form.lines[: self._form.first_line - 1]}
        rows: list[str] = []
        for line in _text(block).split("\n")[:-1]:
            bare = line.strip()
            if bare.strip(separator) and bare not in repeated and not is_comment(bare, separator):
                rows.append(line)
            else:
                self.lines.skip(self._rows + len(rows))
        if not rows:
            return []
        return self._plain("".join(f"{row}\n" for row in rows).encode()) or self._by_line(rows)

    def _by_line(self, lines: Sequence[str]) -> list[bytes]:
        """The columns line by line: cells over several lines, and cells that are missing or empty at the ends."""
        separator = self._form.separator
        errors: list[FieldError] = []
        cells: list[list[str]] = [[] for _ in self._indices]
        rows = 0
        left = iter(lines)
        for line in left:
            taken = 1
            while line.count('"') % 2 and separator.strip() and taken < _MOST_CELL_LINES:
                following = next(left, None)
                if following is None:
                    break
                line, taken = f"{line}\n{following}", taken + 1
            row = _cells(line, separator)
            while len(row) > self._width and not row[-1]:
                row.pop()
            row += [""] * (self._width - len(row) if self._width - len(row) <= self._spare else 0)
            if len(row) == self._width:
                for column, index in zip(cells, self._indices, strict=True):
                    column.append(row[index])
            else:
                errors.append(self._ragged(self._rows + rows, line, len(row)))
            self.lines.skip(self._rows + rows + 1, taken - 1)
            rows += 1
        if errors:
            raise _many(errors, len(errors), self.lines.of(self._rows + rows - 1))
        return ["\n".join(column).encode() for column in cells]

    @property
    def _spare(self) -> int:
        """Columns at the end of a row that are not taken, and may be missing."""
        return self._width - 1 - max(self._indices)

    def _ragged(self, row: int, line: str, cells: int) -> FieldError:
        message = f"line {self.lines.of(row)} must have {self._width} cells, got {cells}: {line[:MOST_QUOTED]!r}"
        return FieldError(pointer="", row=row + 1, value=line[:MOST_QUOTED], code="ragged", message=message)

    def _numbers(self, block: _Block) -> list[FloatArray]:
        """A block's columns as numbers. Raises InvalidError with every cell of it that is none."""
        if not block.columns:
            return [np.empty(0) for _ in self._indices]
        columns = [self._column(index, text) for index, text in zip(self._indices, block.columns, strict=True)]
        numbers = [column for column in columns if column is not None]
        if len(numbers) == len(columns):
            return numbers
        if not block.careful:
            return self._numbers(_Block(block.text, self._careful(block.text), careful=True))
        errors, total = [], 0
        for index, text, column in zip(self._indices, block.columns, columns, strict=True):
            for row, rule in self._numerals.wrong(text) if column is None else ():
                total += 1
                if total <= MOST_ERRORS:
                    errors.append(self._wrong(index, text, row, rule))
        rows = block.columns[0].count(b"\n")
        raise _many(sorted(errors, key=lambda error: error.row or 0), total, self.lines.of(self._rows + rows))

    def _column(self, index: int, text: bytes) -> FloatArray | None:
        numbers = None if index in self._stamps else self._numerals.floats(text)
        if numbers is None and self._channels[index] == "time_s":
            stamps = self._stamps.setdefault(index, Stamps())
            numbers = stamps.seconds(_text(text).split("\n"))
            if numbers is None:
                del self._stamps[index]
        return numbers

    def _wrong(self, index: int, text: bytes, row: int, rule: str) -> FieldError:
        cell = _text(text.split(b"\n")[row])[:MOST_QUOTED]
        name, row = self._channels[index], self._rows + row
        message = f"{name}[{row}] (line {self.lines.of(row)}) {rule}, got {cell!r}"
        pointer = f"/channels/{name}/{row}"
        return FieldError(pointer=pointer, row=row + 1, value=cell, code="not_a_number", message=message)

    def _refuse_doubt(self, block: _Block) -> None:
        """Raise InvalidError where a cell may be read in two ways."""
        for index, text in zip(self._indices, block.columns, strict=True):
            if doubt := self._numerals.doubtful(text):
                raise doubtful_number(self._channels[index], doubt, self._rows + doubt[0], self.lines.of)


#: Separators at the ends of lines that are taken off. Chosen: as many as a tidy file has.
_MOST_CLOSING = 16


def _many(errors: Sequence[FieldError], total: int, line: int) -> InvalidError:
    more = "" if total == 1 else f"; {total} errors up to line {line}"
    return InvalidError(errors[0].message + more, errors=errors, total=total)
