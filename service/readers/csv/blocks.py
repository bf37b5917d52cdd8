"""A CSV file's bytes -> blocks of whole lines in UTF-8, whatever its encoding (UTF-8, UTF-16, Latin-1) and line ends."""

import codecs
from collections.abc import Iterator

from service.errors import MOST_QUOTED
from service.readers.csv.lines import text_of, wrong_line
from service.readers.detect import ByteSource
from service.readers.limits import LONGEST_LINE_BYTES

#: Bytes of the first block, which must hold the header rows, and of each block after it.
_FIRST_BLOCK = 1 << 17
_BLOCK = 1 << 16


def blocks(source: ByteSource) -> Iterator[bytes]:
    """A file's text in UTF-8 (or Latin-1, as it was), in blocks of whole lines that all end in a line feed.

    Raises InvalidError on a line that is too long, on NULs and on text that is not what its byte order mark says.
    """
    block = source.read(_FIRST_BLOCK)
    decoder = _utf16_decoder(block)
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
        if len(text) - end > LONGEST_LINE_BYTES:
            rule = f"must not be longer than {LONGEST_LINE_BYTES} bytes"
            raise wrong_line(line + text.count(b"\n"), rule, "line_too_long", text_of(text[end : end + MOST_QUOTED]))
        whole, rest = text[:end].replace(b"\r\n", b"\n"), text[end:]
        if (nul := whole.find(b"\0")) >= 0:
            raise wrong_line(line + whole.count(b"\n", 0, nul), "must be text, got a NUL byte", "not_text")
        if whole:
            yield whole
        line += whole.count(b"\n")
        block = b"" if last else source.read(_BLOCK)


def _utf16_decoder(head: bytes) -> codecs.IncrementalDecoder | None:
    """How to decode UTF-16, with or without its byte order mark; None for any other text."""
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
        raise wrong_line(
            line, "or a line soon after it is not UTF-16, as the file's beginning says", "not_text"
        ) from None
