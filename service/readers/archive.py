"""ZIP archives: which files in one may be records, and one of them unpacked, no further than the limits allow."""

import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from service.errors import InvalidError, TooLargeError
from service.readers.limits import Limits

#: Suffixes of what is never a record; files in an archive are often accompanied by such.
_NO_RECORDS = (
    ".pdf", ".png", ".jpg", ".jpeg", ".docx", ".doc", ".md", ".html", ".xml", ".json", ".zip", ".exe", ".py", ".m",
)  # fmt: skip
_BLOCK = 1 << 20
_MAX_MEMBERS = 10_000


def check_archive(path: Path, limits: Limits) -> list[zipfile.ZipInfo]:
    """The files of an archive that states to unpack to no more than the limits allow. Raises InvalidError, TooLargeError."""
    try:
        with zipfile.ZipFile(path) as archive:
            listed = archive.infolist()
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError) as error:
        raise InvalidError(f"the ZIP archive cannot be read: {error}") from None
    if len(listed) > _MAX_MEMBERS:
        raise TooLargeError(f"a ZIP archive must not hold more than {_MAX_MEMBERS} files, got {len(listed)}")
    packed, most = path.stat().st_size, most_unpacked(path, limits)
    if sum(info.file_size for info in listed) > most:
        raise TooLargeError(f"a ZIP archive of {packed} bytes must not unpack to more than {most} bytes, got more")
    return listed


def most_unpacked(path: Path, limits: Limits) -> int:
    """Bytes that an archive may unpack to."""
    return min(limits.most_bytes, max(limits.free_bytes, limits.most_ratio * path.stat().st_size))


def members(path: Path, limits: Limits) -> list[str]:
    """The names of the files in an archive that may be records."""
    listed = [
        info for info in check_archive(path, limits) if info.filename
    ]  # zipfile takes no empty name for a folder's
    names = [info.filename for info in listed if not info.is_dir() and info.file_size]
    return [
        name
        for name in names
        if not PurePosixPath(name).name.startswith(".")
        and "__MACOSX/" not in name
        and not name.lower().endswith(_NO_RECORDS)
    ]


@contextmanager
def unpacked(path: Path, name: str, limits: Limits) -> Iterator[Path]:
    """One file of an archive, beside it. Raises InvalidError where it is encrypted or damaged, else TooLargeError."""
    most = most_unpacked(path, limits)
    with tempfile.NamedTemporaryFile(dir=path.parent) as plain:
        try:
            with zipfile.ZipFile(path) as archive, archive.open(name) as member:
                while block := member.read(_BLOCK):
                    plain.write(block)
                    if plain.tell() > most:
                        raise TooLargeError(f"{name!r} must not unpack to more than {most} bytes, got more")
        except (
            OSError,
            ValueError,
            EOFError,
            RuntimeError,
            NotImplementedError,
            zipfile.BadZipFile,
            zlib.error,
        ) as error:
            raise InvalidError(f"{name!r} in the ZIP archive cannot be unpacked: {error}") from None
        plain.flush()
        yield Path(plain.name)
