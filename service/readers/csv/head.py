"""The top of a CSV file: its encoding, its separator, its names and units; and its text as blocks of whole lines."""

import codecs
import csv
from collections.abc import Iterator
from dataclasses import dataclass

from service.errors import FieldError, InvalidError
from service.readers.column_names import Header, header_of, with_unit
from service.readers.csv.decimals import NUMBER
from service.readers.detect import ByteSource
from service.readers.limits import Limits

_TOP = 1 << 17
_BLOCK = 1 << 16
_LONGEST_LINE = 1 << 16
_SEPARATORS = "\t;,"
_COMMENTS = ("#", "%", "//")
_SHOWN = 80


@dataclass(frozen=True, slots=True)
class Layout:
    """What the top of a file says: the data begin at byte `start` of the first block, on line `line` (from 1)."""

    separator: str
    headers: tuple[Header, ...]
    start: int
    line: int


def wrong_line(line: int, rule: str, code: str, got: str = "") -> InvalidError:
    """The error of a line that cannot be part of a table."""
    shown = got[:_SHOWN]
    message = f"line {line} {rule}" + (f", got {shown!r}" if got else "")
    return InvalidError(message, errors=[FieldError(pointer="", code=code, message=message, value=shown)])


def text_of(line: bytes) -> str:
    """A line as text: UTF-8, or else Latin-1, which has the signs of all units where Windows has them."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def is_comment(line: str, separator: str) -> bool:
    """Whether a line is a comment; a semicolon begins one where it does not separate."""
    bare = line.lstrip().lstrip('"')
    return bare.startswith(_COMMENTS) or (bare.startswith(";") and separator != ";")


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes, without blanks around them."""
    if '"' in line:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(separator)]


def blocks(source: ByteSource) -> Iterator[bytes]:
    """A file's text in UTF-8 (or Latin-1, as it was), in blocks of whole lines that all end in a line feed.

    Raises InvalidError on a line that is too long, on NULs and on text that is not what its byte order mark says.
    """
    block = source.read(_TOP)
    decoder = _decoder(block)
    block = block.removeprefix(codecs.BOM_UTF8)
    rest, line, returns_alone = b"", 1, False
    while block or rest:
        last = not block
        text = block if decoder is None else _decoded(decoder, block, last, line)
        if line == 1 and not rest:
            returns_alone = b"\r" in text and b"\n" not in text
        if returns_alone:
            text = text.replace(b"\r", b"\n")
        text = rest + text + (b"\n" if last else b"")
        end = text.rfind(b"\n") + 1
        if len(text) - end > _LONGEST_LINE:
            rule = f"must not be longer than {_LONGEST_LINE} bytes"
            raise wrong_line(line + text.count(b"\n"), rule, "line_too_long", text_of(text[end : end + _SHOWN]))
        whole, rest = text[:end].replace(b"\r\n", b"\n"), text[end:]
        if (nul := whole.find(b"\0")) >= 0:
            raise wrong_line(line + whole.count(b"\n", 0, nul), "must be text, got a NUL byte", "not_text")
        if whole:
            yield whole
        line += whole.count(b"\n")
        block = b"" if last else source.read(_BLOCK)


def _decoder(head: bytes) -> codecs.IncrementalDecoder | None:
    """How to decode UTF-16, with or without its mark; None for text in bytes."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return codecs.getincrementaldecoder("utf-16")()
    sample = head[:512]
    half = len(sample) // 2
    for name, zeros, others in (("utf-16-le", sample[1::2], sample[::2]), ("utf-16-be", sample[::2], sample[1::2])):
        if half and zeros.count(0) > 0.9 * half and others.count(0) == 0:
            return codecs.getincrementaldecoder(name)()
    return None


def _decoded(decoder: codecs.IncrementalDecoder, block: bytes, last: bool, line: int) -> bytes:
    try:
        return decoder.decode(block, last).encode("utf-8")
    except UnicodeError:
        raise wrong_line(line, "or one soon after it is not UTF-16, as the file's beginning says", "not_text") from None


def read_head(block: bytes, limits: Limits) -> Layout:
    """The layout that the first block tells. Raises InvalidError where it has no header that can be understood."""
    separator, comment, start, line = "", "", 0, 0
    for text, end in _lines(block):
        line += 1
        if not text.strip():
            start = end
            continue
        if text.strip().lower().startswith("sep=") and len(text.strip()) <= len("sep=") + 1:
            separator = text.strip()[4:] or "\t"
        elif is_comment(text, separator):
            comment = text.lstrip("#%/; \t")
        else:
            return _from_header(block, text, comment, separator, limits, (start, end, line))
        start = end
    raise wrong_line(max(line, 1), "is the last that was read and no header came before it", "no_header")


def _lines(block: bytes, start: int = 0) -> Iterator[tuple[str, int]]:
    """The lines from a byte on, each with the byte after it."""
    while start < len(block):
        end = block.index(b"\n", start) + 1
        yield text_of(block[start : end - 1]), end
        start = end


def _from_header(
    block: bytes, text: str, comment: str, separator: str, limits: Limits, place: tuple[int, int, int]
) -> Layout:
    """`place`: the byte where the first line that is no comment begins and ends, and its number."""
    start, end, line = place
    separator = separator or next((each for each in _SEPARATORS if each in text), ",")
    titles = _titles(text, separator, line, limits)
    if all(NUMBER.fullmatch(title.replace(",", ".")) for title in titles):
        said = _titles(comment, separator, line, limits) if comment else []
        if len(said) != len(titles):
            raise wrong_line(line, "must be a header with the channels' names", "no_header", text)
        return Layout(separator, tuple(map(header_of, said)), start, line)
    headers = [header_of(title) for title in titles]
    at, before = line, end
    for following, after in _lines(block, end):
        at += 1
        if following.strip() and not is_comment(following, separator):
            cells = cells_of(following, separator)
            if not any(NUMBER.fullmatch(cell.replace(",", ".")) for cell in cells) and any(cells):
                return Layout(separator, _with_units(headers, cells, at), after, at + 1)
            break
        before = after
    else:
        return Layout(separator, tuple(headers), len(block), at + 1)
    return Layout(separator, tuple(headers), before, at)


def _titles(text: str, separator: str, line: int, limits: Limits) -> list[str]:
    titles = cells_of(text, separator)
    while titles and not titles[-1]:
        titles.pop()
    if len(titles) > limits.most_columns:
        raise wrong_line(line, f"must not have more than {limits.most_columns} columns, got {len(titles)}", "too_wide")
    return titles


def _with_units(headers: list[Header], cells: list[str], line: int) -> tuple[Header, ...]:
    """Headers with what the units row says."""
    if len(cells) < len(headers) or any(cells[len(headers) :]):
        raise wrong_line(line, f"must have {len(headers)} cells", "ragged", " ".join(cells))
    return tuple(with_unit(header, cell) for header, cell in zip(headers, cells, strict=False))
