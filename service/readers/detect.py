"""The format of a file, by its first bytes and its suffix; and its bytes, unpacked where it is packed with gzip or one of
those in a ZIP archive, no further than the limits allow."""

import codecs
import gzip
import re
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path, PurePath, PurePosixPath
from typing import BinaryIO, Protocol

from service.errors import MAX_QUOTED, BusyError, InvalidError, TooLargeError
from service.readers.limits import Limits


class Format(StrEnum):
    """The supported file formats."""

    TEXT = "CSV"
    TDMS = "TDMS"
    MDF4 = "MDF4"
    PARQUET = "Parquet"
    WORKBOOK = "workbook"
    MATLAB = "MATLAB"
    HDF5 = "HDF5"
    ZIP = "ZIP"


#: The formats by the names that people know them by, for messages.
FORMATS = "CSV, XLSX, ODS, TDMS, MDF4, MATLAB, HDF5, Parquet or a ZIP archive of one"


class ByteSource(Protocol):
    """A file, or a gzip file being unpacked."""

    def read(self, size: int, /) -> bytes:
        """At most `size` bytes; none at the end."""


_GZIP = b"\x1f\x8b"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_ARCHIVE = b"PK\x03\x04"
_MAGIC = {
    b"TDSm": Format.TDMS,
    b"MDF     ": Format.MDF4,
    b"UnFinMF ": Format.MDF4,
    b"PAR1": Format.PARQUET,
    b"MATLAB 5": Format.MATLAB,
    b"MATLAB 7": Format.HDF5,
    _HDF5: Format.HDF5,
    b"\xd0\xcf\x11\xe0": Format.WORKBOOK,
    _ARCHIVE: Format.ZIP,
}
_SUFFIXES = {
    ".tdms": Format.TDMS, ".mf4": Format.MDF4, ".mdf": Format.MDF4, ".parquet": Format.PARQUET, ".xlsx": Format.WORKBOOK,
    ".ods": Format.WORKBOOK, ".h5": Format.HDF5, ".hdf5": Format.HDF5, ".mat": Format.MATLAB, ".zip": Format.ZIP,
}  # fmt: skip
_FOREIGN = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"GIF8": "a GIF picture",
    b"BM": "a BMP picture",
    b"II*\0": "a TIFF picture",
    b"%PDF": "a PDF document",
    b"SQLite f": "a database",
    b"\x7fELF": "a program",
    b"7z\xbc\xaf": "a 7z archive (ZIP and gzip are accepted)",
    b"Rar!": "a RAR archive (ZIP and gzip are accepted)",
    b"\x28\xb5\x2f\xfd": "a Zstandard archive (gzip is accepted)",
    b"BZh": "a bzip2 archive (gzip is accepted)",
    b"\xfd7zXZ": "an xz archive (gzip is accepted)",
    _GZIP: "a file packed twice with gzip (unpack it once)",
    b"DIAEXT": "the header of a DIAdem file (DIAdem and its libraries save it as TDMS or CSV)",
    b"|CF,": "an imc FAMOS file (FAMOS exports CSV, XLSX and MATLAB files)",
    b"IGOR": "an Igor Pro text file (Igor saves waves as delimited text with their names)",
    b"CPYA": "an Origin project (Origin exports a worksheet as CSV or XLSX)",
    b"\x93NUMPY": "an array of NumPy, which has no titles (numpy.savetxt with header= writes them)",
    b"MULTI_STREAM_FIL": "a Dewesoft file (Dewesoft exports CSV, MATLAB, MDF4 and TDMS files)",
    b"FORMAT\0": "an MTS RPC file (RPC Pro and nCode save it as CSV or MATLAB file)",
    b"<hCNF": "an AiM file (RaceStudio exports CSV files)",
    b"LOGG": "a Vector BLF log (CANoe and CANape convert it with its database to MDF4 or CSV)",
    b"RIFF": "a RIFF file, as sound is kept in (save the channels as CSV or MATLAB file)",
    b":WFM#": "a Tektronix waveform (the oscilloscope saves CSV files too)",
    b"AG10": "a Keysight waveform (the oscilloscope saves CSV and HDF5 files too)",
    b"ARROW1": "an Arrow file (pyarrow, polars and pandas write Parquet as well)",
} | {
    magic: what
    for magics, what in {
        (b"\x94\x13", b"\x91\x13"): "an HBM catman file (catman exports CSV, MATLAB, MDF4 and TDMS files)",
        (b"CDF\x01", b"CDF\x02", b"CDF\x05"): "a NetCDF 3 file (`nccopy -k nc4` makes HDF5 of it, `ncdump` text)",
        (b"[{", b"{"): "JSON: send it to POST /v1/clutches/ID/runs",
    }.items()
    for magic in magics
}
#: Beginnings that a text may have too.
_AMBIGUOUS = {b"BM", b"LOGG", b"RIFF"}
#: Suffixes of what is never a record; files in an archive are often accompanied by such.
_NO_RECORDS = (
    ".pdf", ".png", ".jpg", ".jpeg", ".docx", ".doc", ".md", ".html", ".xml", ".json", ".zip", ".exe", ".py", ".m",
)  # fmt: skip
#: Suffixes of files that only the programs of their makers read, and what these export.
_PROGRAMS = {
    ".d7d": "Dewesoft", ".dxd": "Dewesoft", ".d7z": "Dewesoft", ".rsp": "RPC Pro", ".rpc": "RPC Pro", ".xrk": "RaceStudio",
    ".xrz": "RaceStudio", ".drk": "RaceStudio", ".ld": "MoTeC i2", ".blf": "CANoe", ".wdf": "Xviewer", ".sie": "InField",
    ".mem": "Hioki's viewer", ".gbd": "Graphtec's viewer", ".trc": "the oscilloscope", ".wfm": "the oscilloscope",
}  # fmt: skip
#: Bytes that no text has, in any encoding that is read.
BINARY = re.compile(rb"[\x01-\x08\x0e-\x1a\x1c-\x1f]")
_BLOCK = 1 << 20
_MAX_MEMBERS = 10_000
#: What zipfile raises on an archive that is damaged or encrypted, or packed in a way that it does not know.
_DAMAGED = (OSError, ValueError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile, zlib.error)
#: Bytes that are read to detect the format; every magic number is shorter.
_HEAD = 4096


@contextmanager
def opened(path: Path, limits: Limits) -> Iterator[ByteSource]:
    """The file's bytes, unpacked if it is a gzip file. Reading past the limits raises TooLargeError."""
    packed, size = is_packed(path), path.stat().st_size
    with path.open("rb") as file:
        if not packed and size > limits.most_bytes:
            raise TooLargeError(f"a file must not be larger than {limits.most_bytes} bytes, got {size}")
        yield _Unpacked(file, size, limits) if packed else file


def is_packed(path: Path) -> bool:
    """Whether a file is packed with gzip."""
    with path.open("rb") as file:
        return file.read(2) == _GZIP


class _Unpacked:
    """A gzip file being read, up to the limits."""

    def __init__(self, file: BinaryIO, size: int, limits: Limits) -> None:
        self._unpacking = gzip.GzipFile(fileobj=file)
        self._packed = size
        self._most = _max_unpacked_bytes(size, limits)
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
    """The format of a file, by its content first. Raises InvalidError if it is not supported."""
    with opened(path, limits) as source:
        head = source.read(_HEAD)
    shown = repr(filename[-MAX_QUOTED:])
    suffix = PurePath(filename.lower().removesuffix(".gz")).suffix
    if not head:
        raise InvalidError(f"{shown} must not be empty")
    for magic, kind in _MAGIC.items():
        if head.startswith(magic):
            return _format_of_archive(path) if magic == _ARCHIVE else kind
    if _HDF5 in (head[512:520], head[1024:1032], head[2048:2056]):
        return Format.HDF5
    if suffix == ".mat" and head[:2] in (b"\0\0", b"\n\0", b"\x14\0", b"\x1e\0"):
        return Format.MATLAB  # of version 4, which has no magic number
    for magic, foreign in _FOREIGN.items():
        if head.startswith(magic) and (b"\0" in head or not head.isascii() or magic not in _AMBIGUOUS):
            raise InvalidError(f"{shown} must be {FORMATS}, got {foreign}")
    if by_suffix := _SUFFIXES.get(suffix):
        raise InvalidError(
            f"{shown} is not a {by_suffix} file, although its name says so: correct the name, or export the file again"
        )
    if b"\0" in head and utf_16(head) is None and BINARY.search(head):
        program = _PROGRAMS.get(suffix, "the program that wrote it")
        raise InvalidError(
            f"{shown} must be {FORMATS}, got binary data of a format that is not read here: in {program}, export the "
            "channels as one of these"
        )
    return Format.TEXT


def utf_16(head: bytes) -> str | None:
    """The encoding of a UTF-16 text, by its byte order mark or the zero bytes in its first characters."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    even, odd = head[:512:2], head[1:512:2]
    for name, zeros, letters in (("utf-16-le", odd, even), ("utf-16-be", even, odd)):
        if odd and zeros.count(0) > 0.9 * len(odd) and letters.count(0) == 0:
            return name
    return None


def _format_of_archive(path: Path) -> Format:
    """Whether a ZIP archive is a workbook or another archive, by the names in it."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except _DAMAGED:
        return Format.ZIP
    workbook = "[Content_Types].xml" in names or {"mimetype", "content.xml"} <= set(names)
    return Format.WORKBOOK if workbook else Format.ZIP


def check_archive(path: Path, limits: Limits) -> list[zipfile.ZipInfo]:
    """The files of an archive, whose stated unpacked size must be within the limits. Raises InvalidError,
    TooLargeError."""
    try:
        with zipfile.ZipFile(path) as archive:
            listed = archive.infolist()
    except _DAMAGED as error:
        raise InvalidError(f"the ZIP archive cannot be read: {error}") from None
    if len(listed) > _MAX_MEMBERS:
        raise TooLargeError(f"a ZIP archive must not hold more than {_MAX_MEMBERS} files, got {len(listed)}")
    packed = path.stat().st_size
    most = _max_unpacked_bytes(packed, limits)
    if sum(info.file_size for info in listed) > most:
        raise TooLargeError(f"a ZIP archive of {packed} bytes must not unpack to more than {most} bytes, got more")
    return listed


def _max_unpacked_bytes(packed: int, limits: Limits) -> int:
    """The maximum unpacked size of a packed file of this size [bytes]."""
    return min(limits.most_bytes, max(limits.free_bytes, limits.most_ratio * packed))


def members(path: Path, limits: Limits) -> list[str]:
    """The names of files in an archive that may be records."""
    # zipfile takes no empty name for a folder's
    listed = [info for info in check_archive(path, limits) if info.filename and not info.is_dir() and info.file_size]
    return [
        info.filename
        for info in listed
        if not PurePosixPath(info.filename).name.startswith(".")
        and "__MACOSX/" not in info.filename
        and not info.filename.lower().endswith(_NO_RECORDS)
    ]


@contextmanager
def unpacked(path: Path, name: str, limits: Limits) -> Iterator[Path]:
    """Context with one file of an archive, unpacked beside it. Raises InvalidError where it is encrypted or damaged,
    else TooLargeError."""
    most = _max_unpacked_bytes(path.stat().st_size, limits)
    with tempfile.NamedTemporaryFile(dir=path.parent) as plain:
        try:
            with zipfile.ZipFile(path) as archive, archive.open(name) as member:
                while block := member.read(_BLOCK):
                    plain.write(block)
                    if plain.tell() > most:
                        raise TooLargeError(f"{name!r} must not unpack to more than {most} bytes, got more")
        except _DAMAGED as error:
            raise InvalidError(f"{name!r} in the ZIP archive cannot be unpacked: {error}") from None
        plain.flush()
        yield Path(plain.name)


def too_slow(kind: Format, limits: Limits) -> InvalidError:
    """The error for a file that needs more processor time than allowed."""
    message = f"reading the {kind} file took more than {limits.seconds} s of processor time: send it in smaller parts"
    return InvalidError.of(message, code="too_slow")


def overdue(kind: Format, limits: Limits) -> BusyError:
    """The error for a file whose reader took too long by the clock, without using its processor time."""
    return BusyError(
        f"the {kind} file was not read within {limits.wall_seconds} s, because the service is busy: send it again later"
    )
