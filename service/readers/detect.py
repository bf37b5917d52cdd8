"""The format of a file, by its first bytes and its suffix; and its bytes, unpacked where it is packed with gzip."""

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path, PurePath
from typing import BinaryIO, Protocol

from service.errors import MOST_QUOTED, InvalidError, TooLargeError
from service.readers.limits import Limits


class Format(StrEnum):
    """The formats that are read."""

    CSV = "CSV"
    TDMS = "TDMS"
    MDF4 = "MDF4"
    PARQUET = "Parquet"


class ByteSource(Protocol):
    """A file, or a gzip file being unpacked."""

    def read(self, size: int, /) -> bytes:
        """At most `size` bytes; none at the end."""


_GZIP = b"\x1f\x8b"
_MAGIC = {
    b"TDSm": Format.TDMS,
    b"MDF     ": Format.MDF4,
    b"UnFinMF ": Format.MDF4,
    b"PAR1": Format.PARQUET,
}
_SUFFIXES = {".tdms": Format.TDMS, ".mf4": Format.MDF4, ".mdf": Format.MDF4, ".parquet": Format.PARQUET}
_FOREIGN = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"GIF8": "a GIF picture",
    b"BM": "a BMP picture",
    b"II*\0": "a TIFF picture",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a ZIP archive or an Excel workbook (export it as CSV)",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (export it as CSV)",
    b"\x89HDF": "an HDF5 file",
    b"MATLAB 5": "a MATLAB file",
    b"SQLite f": "a database",
    b"\x7fELF": "a program",
    b"\x28\xb5\x2f\xfd": "a Zstandard archive (gzip is accepted)",
    b"BZh": "a bzip2 archive (gzip is accepted)",
    b"\xfd7zXZ": "an xz archive (gzip is accepted)",
    _GZIP: "packed with gzip twice",
    b"{": "JSON: post it to the address of the runs",
}
#: Bytes that are read to detect the format; every magic number is shorter.
_HEAD = 4096


@contextmanager
def opened(path: Path, limits: Limits) -> Iterator[ByteSource]:
    """The file's bytes, unpacked if it is a gzip file. Reading past the limits raises TooLargeError."""
    with path.open("rb") as file:
        packed = file.read(2) == _GZIP
        file.seek(0)
        size = path.stat().st_size
        if not packed and size > limits.most_bytes:
            raise TooLargeError(f"a file must not be larger than {limits.most_bytes} bytes, got {size}")
        yield _Unpacked(file, size, limits) if packed else file


def is_packed(path: Path) -> bool:
    """Whether a file is packed with gzip."""
    with path.open("rb") as file:
        return file.read(2) == _GZIP


class _Unpacked:
    """A gzip file being read, no further than the limits allow."""

    def __init__(self, file: BinaryIO, size: int, limits: Limits) -> None:
        self._unpacking = gzip.GzipFile(fileobj=file)
        self._packed = size
        self._most = min(limits.most_bytes, max(limits.free_bytes, limits.most_ratio * size))
        self._done = 0

    def read(self, size: int, /) -> bytes:
        try:
            block = self._unpacking.read(size)
        except (OSError, EOFError, zlib.error) as error:
            raise InvalidError(f"the gzip file cannot be unpacked: {error}") from None
        self._done += len(block)
        if self._done > self._most:
            raise TooLargeError(
                f"a gzip file of {self._packed} bytes must not unpack to more than {self._most} bytes, got more"
            )
        return block


def sniff(path: Path, filename: str, limits: Limits) -> Format:
    """The format of a file, by content first. Raises InvalidError where it is another one."""
    with opened(path, limits) as source:
        head = source.read(_HEAD)
    shown = repr(filename[-MOST_QUOTED:])
    if not head:
        raise InvalidError(f"{shown} must not be empty")
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return kind
    for magic, foreign in _FOREIGN.items():
        if head.startswith(magic):
            raise InvalidError(f"{shown} must be CSV, TDMS, MDF4 or Parquet, got {foreign}")
    by_suffix = _SUFFIXES.get(PurePath(filename.lower().removesuffix(".gz")).suffix)
    if by_suffix:
        raise InvalidError(f"{shown} is named as {by_suffix} but does not begin as one")
    return Format.CSV
