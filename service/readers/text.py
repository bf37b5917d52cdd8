"""Text of any make -> a table: encoding, separator and titles by what is understood best; then its rows, block by block.

A block of plain rows of numbers is read at once; any other goes through `grid`'s rows and `numerals`. Errors name line,
column and value.
"""

import codecs
import csv
import io
import re
import time
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
import pydantic_core
from numpy.typing import NDArray

from service.errors import MAX_ERRORS, MAX_QUOTED, FieldError, InvalidError, Notice, TooLargeError
from service.readers.column_names import named_columns, recognised
from service.readers.detect import BINARY, ByteSource, Format, overdue, too_slow, utf_16
from service.readers.limits import LIMITS, LONGEST_LINE_BYTES, Limits
from service.readers.markup import as_lines
from service.readers.numerals import Numerals, is_stamp
from service.readers.plain_numbers import plain_columns
from service.readers.table import Reading, Table
from service.readers.table_finder import (
    MAX_ROWS,
    TURNED,
    DataRows,
    Layout,
    find_table,
    is_value,
    no_table,
    table_in,
    turned,
)

#: Bytes of the beginning, which must hold the titles, and of a piece of rows that are no plain numbers, which take 60 times
#: as much memory; and of a block of rows. Chosen: a quarter of it takes 1.2 times as long.
_HEAD, _BLOCK = 1 << 17, 1 << 19
#: Rows that are looked at at once for the decimal sign. Chosen: the first one mostly shows it.
_SETTLED = 64
_COMMENTS = ("#", "%", "//")
_NEWLINE, _COMMA = b"\n,"
_SEPARATOR_LINE = re.compile(r"\s*sep=(.?)\s*", re.IGNORECASE)
#: The encoding of text that is not UTF-8; and others that are tried for titles that the caller names, or for a suggestion:
#: of those that read as many titles the first.
_WESTERN = ("cp1252",)
_OTHERS = ("cp1250", "cp1254", "gb18030", "shift_jis", "euc_jp", "big5", "euc_kr", "cp1251")
#: Titles that are known in Western text, from which on no other encoding is tried. Chosen: of the four that a test has.
_CLEAR = 3
#: Pairs of bytes as Chinese text has them, and single ones as Western text has them.
_CHINESE = re.compile(rb"(?:[\x00-\x7f]|[\xa1-\xf7][\xa1-\xfe])*")
#: Cells of which the last is in quotes and goes on; a quotation mark within a cell is no other (3/4").
_OPEN = re.compile(r'(?:(?:[ \t]*"(?:[^"]|"")*+"[^;,\t|\n]*|(?![ \t]*")[^;,\t|\n]*)[;,\t|\n])*+[ \t]*"(?:[^"]|"")*+')
#: A quotation mark that is all of a cell: a ditto mark, where no cell is in quotes.
_DITTO = re.compile(r'(?<![^;,\t|]) ?" ?(?![^;,\t|])')
#: What is neither in numbers nor in points in time.
_WORDS = re.compile(r"[^\d \n.,;:|\teETZ/+-]")
#: The share of lines with a tab of a text that tabs separate. Chosen: title blocks have none.
_MOST_OF = 0.8
#: Digits and signs of numbers of full width, and what they stand for.
_WIDE, _NARROW = re.compile("[０-９]"), str.maketrans("０１２３４５６７８９．，－＋：／　", "0123456789.,-+:/ ")
#: Bytes of a text in HTML or XML. Chosen: a spreadsheet's 65,536 rows have less.
_MOST_MARKED = 1 << 25
#: Lines that one cell in quotes may go over.
_MAX_CELL_LINES = 5

#: Opens the file's bytes from their beginning.
Open = Callable[[], AbstractContextManager[ByteSource]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """The format of a text: encoding, separator (" ", " ": at least as many blanks), its first rows, their lines from
    1, and the table in them."""

    encoding: str
    separator: str
    layout: Layout
    rows: list[list[str]]
    lines: list[int]

    @property
    def first_line(self) -> int:
        """The line of the first row of data, from 1."""
        return self.lines[self.layout.start] if self.layout.start < len(self.lines) else self.lines[-1] + 1


def read_text(opened: Open, reading: Reading, limits: Limits, *, any_encoding: bool = False) -> Table:
    """The table of a text in UTF-8, UTF-16 or a Western encoding, or in another if the caller names its titles or
    allows `any_encoding`. Raises InvalidError where it has no titles, or its lines are no text."""
    with opened() as source:
        first = source.read(_HEAD)
    whole = len(first) < _HEAD
    if not whole and b"\n" in first and b"\0" not in first:  # whole lines alone; with zeros it may be UTF-16
        first = first[: first.rindex(b"\n") + 1]
    if first.lstrip(b"\xef\xbb\xbf\xff\xfe\0 \r\n\t").startswith(b"<") and (lines := _unmarked(opened)) is not None:
        return read_text(lambda: nullcontext(io.BytesIO(lines)), reading, limits)
    if not first.strip():
        rule = "is empty, and so is the rest of the file: send a file with a header and rows of numbers"
        raise wrong_line(1, rule, "no_header")
    try:
        form = _form(first, reading, limits, any_encoding=any_encoding or bool(named_columns(reading)))
    except InvalidError:
        if (on_its_side := _turned(first, reading)) is None:
            raise
        if not whole:
            message = f"a table on its side must have less than {_HEAD} bytes: send it with a column a channel"
            raise TooLargeError(message) from None
        table = read_text(lambda: nullcontext(io.BytesIO(on_its_side)), reading, limits)
        return replace(table, notices=[*table.notices, TURNED])
    body = _DataBody(opened, form, reading, limits)
    return table_in(
        body.data, first_line=form.first_line, read=body.read, rows_read=lambda: body.rows, line_of=body.line_of
    )


def _unmarked(opened: Open) -> bytes | None:
    """The lines of the tables in an HTML or XML text; None for any other text. Raises TooLargeError."""
    with opened() as source:
        content = source.read(_MOST_MARKED + 1)
    text = content.decode(_encodings(content, any_encoding=False)[0].replace("utf-8", "utf-8-sig"), "replace")
    lines = as_lines(text)
    if lines is not None and len(content) > _MOST_MARKED:
        raise TooLargeError(
            f"a table in HTML or XML must not be larger than {_MOST_MARKED} bytes: save it as CSV or XLSX"
        )
    return None if lines is None else lines.encode()


# --- bytes -> lines ---


class _Block(NamedTuple):
    """Whole lines, all with a line feed at their end: whether they are the last, whether the last line had one (`ended`),
    and how many zero bytes follow."""

    text: str
    last: bool
    ended: bool = True
    zeros: int = 0


def _blocks(source: ByteSource, encoding: str) -> Iterator[_Block]:
    """A file's text in blocks of whole lines; a cell in quotes is not cut. Zero bytes at the end are left out.

    Raises InvalidError on a line that is too long and on text that is not in its encoding.
    """
    decoder = codecs.getincrementaldecoder("utf-8-sig" if encoding == "utf-8" else encoding)()
    lines = io.IncrementalNewlineDecoder(decoder, translate=True)
    unfinished, line, block, zeros = "", 1, source.read(_BLOCK), 0
    while block:
        following = source.read(_BLOCK)
        try:
            text = unfinished + _narrow(lines.decode(block, not following))
        except UnicodeError:
            rule = f"or a line soon after it is not {encoding.upper()}, unlike the lines before: "
            rule += "this is binary data after text; export the file as text" if b"\0" in block else "save it as UTF-8"
            raise wrong_line(line, rule, "not_text") from None
        if (nul := text.find("\0")) >= 0:
            zeros = _zeros_to_the_end(text[nul:], following, source)
            if zeros == 0:
                raise _zeros_amid(line + text.count("\n", 0, nul), text[nul:])
            text, following = text[:nul], b""
        last = not following
        end = text.rfind("\n") + 1
        if not last and _is_open(text[:end]):
            end = text.rfind("\n", 0, text.rfind('"', 0, end)) + 1
        if len(text) - end > LONGEST_LINE_BYTES + 2 * _BLOCK * ('"' in text[end:]):
            rule = f"must not be longer than {LONGEST_LINE_BYTES} bytes"
            raise wrong_line(line + text.count("\n", 0, end), rule, "line_too_long", text[end : end + MAX_QUOTED])
        ended = not last or end == len(text)
        if last:
            text += "" if ended else "\n"
            end = len(text)
        complete, unfinished = text[:end], text[end:]
        if complete or zeros:
            yield _Block(complete, last, ended, zeros)
        line += complete.count("\n")
        block = following


def _narrow(text: str) -> str:
    """A text with full-width digits (East Asian keyboards) and signs of numbers replaced by plain ones."""
    return text.translate(_NARROW) if not text.isascii() and _WIDE.search(text) else text


def _zeros_to_the_end(tail: str, following: bytes, source: ByteSource) -> int:
    """The number of zero bytes at the end of a text, left by loggers that allocate files in blocks; 0 if anything
    follows them."""
    count, stripped = len(tail), tail.strip("\0\r\n")
    while following and not stripped:
        count += len(following)
        stripped, following = following.strip(b"\0\r\n").decode("latin-1"), source.read(_BLOCK)
    return 0 if stripped else count


def _zeros_amid(line: int, tail: str) -> InvalidError:
    """The error for zero bytes in the middle of a text; `line` has the first of them."""
    count = len(tail) - len(tail.lstrip("\0"))
    if BINARY.search(tail.encode("utf-8", "replace")):
        rule = "begins binary data, which is no text: in the program that wrote the file, export it as text"
    else:
        rule = (
            f"has zero bytes ({count} in a row), as a logger leaves where power was lost; the {line - 1} lines before it "
            "are text. Send these as one file, and what follows the zeros as another"
        )
    return wrong_line(line, rule, "not_text")


def _encodings(head: bytes, *, any_encoding: bool) -> list[str]:
    """The possible encodings of a text, likeliest first."""
    if wide := utf_16(head):
        return [wide]
    if _decodes(head, "utf-8"):
        return ["utf-8"]
    tried = (*_WESTERN, *_OTHERS) if any_encoding else _WESTERN
    encodings = [name for name in tried if _decodes(head, name)] or ["latin-1"]
    return sorted(encodings, key=lambda name: name != "gb18030") if _CHINESE.fullmatch(head) else encodings


def _decodes(head: bytes, encoding: str) -> bool:
    try:
        codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeError:
        return False
    return True


# --- lines -> the table ---


def _form(first: bytes, reading: Reading, limits: Limits, *, any_encoding: bool) -> _Form:
    """The encoding, the separator and the table by which most titles are recognised."""
    best: _Form | None = None
    named = named_columns(reading)
    unfit: list[list[str]] = []
    for encoding in _encodings(first, any_encoding=any_encoding):
        text = _lines(first, encoding)[: reading.skip_rows + MAX_ROWS]
        for separator in _separators(text[reading.skip_rows :]):
            numbered = [*_rows(text, separator, reading.skip_rows)]
            comments = frozenset(row for row, (_, _, comment) in enumerate(numbered) if comment)
            rows = [cells for _, cells, _ in numbered]
            layout = find_table(rows, comments, named)
            unfit = unfit or rows
            if layout is not None and (best is None or layout.fit() > best.layout.fit()):
                lines = [line + 1 for line, _, _ in numbered]
                best = _Form(encoding=encoding, separator=separator, layout=layout, rows=rows, lines=lines)
        clear = encoding.startswith("utf") or (encoding in _WESTERN and best and best.layout.score[0] >= _CLEAR)
        if best is not None and clear:
            break
    if best is None:
        raise no_table(unfit, named)
    if len(best.layout.headings) > limits.most_columns:
        rule = f"must not have more than {limits.most_columns} columns, got {len(best.layout.headings)}"
        raise wrong_line(best.first_line, rule, "too_wide")
    return best


def _lines(block: bytes, encoding: str) -> list[str]:
    return "".join(text for text, *_ in _blocks(io.BytesIO(block), encoding)).split("\n")[:-1]


def _turned(first: bytes, reading: Reading) -> bytes | None:
    """A complete text with one channel per line, transposed, if a separator makes it a table; else None."""
    text = _lines(first, _encodings(first, any_encoding=False)[0])[reading.skip_rows :]
    for separator in _separators(text):
        rows = [cells for _, cells, _ in _rows(text, separator) if any(cells)]
        if on_its_side := turned(rows, named_columns(reading)):
            if not first.endswith((b"\n", b"\r", b"\0")) and not is_whole(rows[-1][-1], rows[-1][1:-1]):
                rule = "has no line feed at its end and may be cut: send the complete file"
                raise wrong_line(len(text), rule, "truncated", rows[-1][-1])
            return "".join("\t".join(row) + "\n" for row in on_its_side[0]).encode()
    return None


def _separators(lines: Sequence[str]) -> list[str]:
    """The separators to try: the one that the text names, or all that it contains."""
    lines = lines[:MAX_ROWS]
    if stated := next(filter(None, map(_SEPARATOR_LINE.fullmatch, lines)), None):
        return [stated[1] or "\t"]
    present = [separator for separator in "\t;,|" if any(separator in line for line in lines)]
    tabbed = sum("\t" in line for line in lines) > _MOST_OF * len([line for line in lines if line.strip()])
    blanks = any(" " in line.strip() for line in lines) and not tabbed  # then blanks are within titles
    return [*present, "  ", " "] if blanks else present or [","]


def _rows(lines: Sequence[str], separator: str, skipped: int = 0) -> Iterator[tuple[int, list[str], bool]]:
    """Rows: the index of the line that each begins with, its cells, and whether it is a comment, without its sign."""
    numbered = enumerate(lines)
    for index, line in numbered:
        if index < skipped or _SEPARATOR_LINE.fullmatch(line):
            continue
        if '"' in line and separator.strip(" ") and line.count('"') == len(_DITTO.findall(line)):
            line = _DITTO.sub('""""', line)
        while '"' in line and separator.strip() and _is_open(line) and line.count("\n") < _MAX_CELL_LINES:
            line += "\n" + next(numbered, (0, '"'))[1]
        if comment := _is_comment(line, separator):
            line = line.lstrip('#%/;" \t').rstrip('"')
        yield index, _cells(line, separator), comment


def _is_comment(line: str, separator: str) -> bool:
    """Whether a line is a comment; a semicolon begins one unless it is the separator."""
    if line[:1].isdigit():
        return False
    bare = line.lstrip().lstrip('"')
    return bare.startswith(_COMMENTS) or (bare.startswith(";") and separator != ";")


def _is_open(text: str) -> bool:
    """Whether a text ends within a cell in quotes."""
    return '"' in text and text.count('"') % 2 == 1 and _OPEN.fullmatch(text) is not None


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


def is_whole(cell: str, others: Sequence[str]) -> bool:
    """Whether the last cell of a text without a line feed at its end is whole: it is empty or in quotes, or has as many
    decimals as each of the other values."""
    values = [cell, *filter(is_value, others)]
    decimals = {len(re.split("[.,]", value, maxsplit=1)[-1]) if re.search("[.,]", value) else 0 for value in values}
    return not cell or cell.endswith('"') or (len(values) > 1 and len(decimals) == 1 and decimals != {0})


def wrong_line(line: int, rule: str, code: str, got: str = "") -> InvalidError:
    """The error for a line that cannot be part of a table; `line` counts from 1."""
    shown = got[:MAX_QUOTED]
    message = f"line {line} {rule}" + (f", got {shown!r}" if got else "")
    return InvalidError.of(message, code=code, value=shown)


# --- the rows of data ---


class _DataBody:
    """The rows of data, block by block: columns of text into columns of numbers."""

    def __init__(self, opened: Open, form: _Form, reading: Reading, limits: Limits) -> None:
        self._opened, self._form, self._limits = opened, form, limits
        self.data = DataRows(form.rows, form.layout)
        named, first = len(form.layout.headings), self.data.first_row
        self._width = named if any(first[named:]) else max(named, len(first))
        #: Cells that a row must have: as many as most rows have up to their last that is not empty.
        filled = (len("".join("x" if cell else " " for cell in row).rstrip()) for row in form.rows[form.layout.start :])
        self._usual_width = Counter(filled).most_common(1)[0][0] if first else self._width
        self._separator = form.separator
        if form.separator == "  " and len(_cells(" ".join(first), " ")) == self._width:
            self._separator = " "  # titles are two blanks apart, cells may be one
        self._reading = reading
        self._begin()

    def _begin(self) -> None:
        self.data.begin()
        self._numerals = Numerals(self._reading)
        #: Of each block its first row, and the lines of its rows from 1; the line that comes next.
        self._lines: list[tuple[int, Sequence[int]]] = []
        self._line = self._form.first_line
        #: How many rows were read.
        self.rows = 0

    def line_of(self, row: int) -> int:
        """The line of a row that was read: rows count from 0, lines from 1."""
        first, lines = self._lines[bisect_right(self._lines, row, key=lambda block: block[0]) - 1]
        return lines[row - first]

    def read(self, channels: Mapping[int, str]) -> list[NDArray[Any]]:
        """The columns [n] by index. Raises InvalidError naming line and value, TooLargeError past the limits."""
        self._begin()
        self._settle(channels)
        times = [at for at, name in channels.items() if name == "time_s"]
        dated = any(is_stamp("".join(self.data.first_row[at : at + 1])) for at in times)
        parts: list[list[NDArray[Any]]] = [[] for _ in channels]
        most = self._limits.most_values // len(channels)
        end, late = time.thread_time() + self._limits.seconds, time.monotonic() + self._limits.wall_seconds
        for block, last, ended, zeros in self._blocks():
            if time.thread_time() > end:
                raise too_slow(Format.TEXT, self._limits)
            if time.monotonic() > late:
                raise overdue(Format.TEXT, self._limits)
            if not ended:
                block = self._without_cut_line(block, channels)
            if zeros:
                line = self._line + block.count("\n") - 1
                message = f"left out: {zeros} zero bytes after line {line}, as a logger leaves where power was lost"
                self.data.notices.append(Notice(code="lines_left_out", message=message))
            for columns in self._columns(block, channels, last=last, dated=dated):
                for part, column in zip(parts, columns, strict=True):
                    part.append(column)
                self.rows += columns[0].size
            if self.rows > most:
                rule = f"must not have more than {most} rows"
                raise TooLargeError(f"a file of {len(channels)} channels {rule}: send it in parts")
        self.data.end()
        joined = []
        while parts:
            part = parts.pop(0) or [np.empty(0)]
            masked = any(isinstance(values, np.ma.MaskedArray) for values in part)
            joined.append((np.ma.concatenate if masked else np.concatenate)(part))
        return joined

    def _columns(
        self, block: str, channels: Mapping[int, str], *, last: bool, dated: bool
    ) -> Iterator[list[NDArray[Any]]]:
        """The columns of a block of plain numbers, or of each piece of any other one."""
        columns = None if dated else self._plain(block, channels)
        if columns is not None:
            self._lines.append((self.rows, range(self._line, self._line + columns[0].size)))
            self._line += columns[0].size
            yield columns
            return
        start = 0
        while start < len(block):
            end = len(block) if '"' in block else block.find("\n", min(start + _HEAD, len(block) - 1)) + 1
            piece, start = block[start:end], end
            yield self._careful(piece, channels, last and end == len(block))
            self._line += piece.count("\n")

    def _blocks(self) -> Iterator[_Block]:
        """The blocks from the first row of data on."""
        above = self._form.first_line - 1
        with self._opened() as source:
            for block in _blocks(source, self._form.encoding):
                start = 0
                while above and start < len(block.text):
                    start = block.text.index("\n", start) + 1
                    above -= 1
                if start < len(block.text) or block.zeros:
                    yield block._replace(text=block.text[start:])

    def _without_cut_line(self, block: str, channels: Mapping[int, str]) -> str:
        """The last block without its last line, if that has no line feed and may be cut within a value."""
        start = block.rfind("\n", 0, -1) + 1
        line = block[start:-1]
        cells = _cells(line, self._separator)
        last = max(channels)
        taken = cells[last] if len(cells) == last + 1 and (channels[last] or is_value(cells[last])) else ""
        above = [row[last] for row in self._form.rows[self._form.layout.start : -1] if len(row) > last]
        if len(cells) > _last_needed(channels) and len(cells) >= self._usual_width and is_whole(taken, above):
            return block
        if not (self.rows or start) or not any(map(is_value, cells)):
            return block  # the only row, or words below the table
        number = self._line + block.count("\n") - 1
        why = "which has no line feed at its end and may be cut"
        message = f"left out: the last line ({number}), {why}: {line[-MAX_QUOTED:]!r}"
        self.data.notices.append(Notice(code="lines_left_out", message=message))
        return block[:start]

    def _settle(self, channels: Mapping[int, str]) -> None:
        """Learn the decimal sign from the first unambiguous cell; a full stop if no cell has a sign."""
        doubtful, quoted, needed = False, False, _last_needed(channels)
        for block, *_ in self._blocks():
            if self._numerals.decimal:
                return
            quoted |= '"' in block
            if "." in block or ("," in block and (self._separator != "," or '"' in block)):
                parsed = (cells for _, cells, _ in self._parsed(block) if len(cells) > needed)
                while rows := list(islice(parsed, _SETTLED)):
                    shown = [[row[at] for row in rows] for at, name in channels.items() if name]
                    doubtful |= self._numerals.settle(shown)
                    if self._numerals.decimal:
                        return
        # cells that a comma separates have none of their own
        comma = self._separator == "," and not quoted
        self._numerals.decimal = self._numerals.decimal or ("" if doubtful and not comma else ".")

    def _plain(self, block: str, channels: Mapping[int, str]) -> list[NDArray[Any]] | None:
        """The columns of a block of numbers alone: plain ones eight digits at a time, others by jiter (pydantic-core's
        reader of JSON); None for any other block."""
        separator, decimal = self._separator, self._numerals.decimal
        if not decimal or (separator != "," and decimal == "." and "," in block):
            return None
        if not separator.strip(" "):
            block = re.sub(r" *\n *", "\n", re.sub(r"[ \t]+", " ", block)).lstrip(" ")
        if decimal == ",":
            block = "" if "." in block else block.replace(",", ".")
        plain = block.replace(separator, ",").encode()
        if (columns := plain_columns(plain, self._width, channels)) is not None:
            return columns
        if not plain or plain.translate(None, b"0123456789.eE+-,\n"):
            return None
        letters = np.frombuffer(plain, np.uint8)
        ends_line = (letters == _NEWLINE)[(letters == _NEWLINE) | (letters == _COMMA)]
        if ends_line.size != self._width * plain.count(b"\n") or not ends_line[self._width - 1 :: self._width].all():
            return None  # not as many cells in each line
        try:
            cells = pydantic_core.from_json(b"[%b]" % plain[:-1].replace(b"\n", b","))
            numbers = np.array(cells, dtype=np.float64).reshape(-1, self._width)
        except (ValueError, OverflowError):
            return None
        return [numbers[:, index].copy() for index in channels]

    def _parsed(self, block: str) -> Iterator[tuple[int, list[str], bool]]:
        return _rows(block.split("\n")[:-1], self._separator)

    def _even(self, block: str) -> list[str] | None:
        """The cells of a block without words, if all rows end in a line feed and have the same number of cells; else
        None."""
        separator, width = self._separator, self._width
        empty = f"\n{separator * (width - 1)}\n"
        if not separator.strip() or _WORDS.search(block) or "//" in block or empty in f"\n{block}":
            return None
        cells = block.replace("\n", f"{separator}\n{separator}").split(separator)
        rows = block.count("\n")
        return cells if len(cells) == (width + 1) * rows + 1 and cells[width :: width + 1].count("\n") == rows else None

    def _careful(self, block: str, channels: Mapping[int, str], last: bool) -> list[NDArray[Any]]:
        """The columns of any other block, without comments, blank lines and repeated titles.

        Raises InvalidError with every line of it that has too few or too many cells, or cells that are no numbers.
        """
        if (cells := self._even(block)) is not None:
            rows_read = range(self._line, self._line + block.count("\n"))
            self._lines.append((self.rows, rows_read))
            even = [cells[index : -1 : self._width + 1] for index in channels]
            return self._numerals.values(channels, even, self.line_of, self.rows)
        readings = ((self._line + at, cells, comment) for at, cells, comment in self._parsed(block))
        lines, rows = self.data.of(readings, self.rows, last=last)
        self._lines.append((self.rows, lines))
        errors = [
            self._ragged(self.rows + row, cells)
            for row, cells in enumerate(rows)
            if len(cells) != self._width and not self._fit(cells, channels)
        ]
        if errors:
            more = "" if len(errors) == 1 else f"; {len(errors)} errors up to line {lines[-1]}"
            raise InvalidError(errors[0].message + more, errors=errors[:MAX_ERRORS], total=len(errors))
        columns = [[cells[index] for cells in rows] for index in channels]
        return self._numerals.values(channels, columns, self.line_of, self.rows)

    def _fit(self, cells: list[str], channels: Mapping[int, str]) -> bool:
        """Make a row as wide as the table, by adding or removing empty cells at its end; false if it cannot be. A row
        that is shorter than most may lack any of its cells, and the last row may be cut."""
        while len(cells) > self._width and not cells[-1]:
            cells.pop()
        if len(cells) > max(_last_needed(channels), self._usual_width - 1):
            cells += [""] * (self._width - len(cells))
        return len(cells) == self._width

    def _ragged(self, row: int, cells: Sequence[str]) -> FieldError:
        line = (self._separator.strip() or " ").join(cells)[:MAX_QUOTED]
        message = f"line {self.line_of(row)} must have {self._width} cells, got {len(cells)}: {line!r}"
        if recognised(cells, ()) > 1:
            message += ". If another table begins there, send it in a separate file"
        return FieldError(pointer="", row=row + 1, value=line, code="ragged", message=message)


def _last_needed(channels: Mapping[int, str]) -> int:
    """The last column that a row must have: that of a channel, if any is read; notes may be missing."""
    return max((at for at, name in channels.items() if name), default=max(channels))
