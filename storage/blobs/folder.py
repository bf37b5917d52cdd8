"""Blobs as files of a local folder, readable for their owner alone: FOLDER/ab/cd/abcd... .

A file is written under another name, synced and then renamed, so that a crash or a power cut leaves it whole or not at all.
The folder holds a mark: one that is not mounted is not taken for an empty store, nor written to.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from storage.blobs.store import MARK
from storage.engine.errors import MissingBlob, RawStoreUnavailable

_FOLDER_MODE = 0o700
#: Where files are until they are whole; what is left there was interrupted.
_PARTIAL = "partial"


class FolderStore:
    """A folder. Made by `opening`."""

    def __init__(self, root: Path) -> None:
        self._root = root

    @property
    def address(self) -> str:
        """Where it is."""
        return f"folder://{self._root}"

    def put(self, name: str, data: bytes | bytearray) -> None:
        """Write a file whole, in place of one of that name."""
        with self._usable():
            self._require_mark()
            self._write(self._path(name), data)

    def get(self, name: str) -> bytes:
        """The bytes of a file."""
        with self._usable():
            try:
                return self._path(name).read_bytes()
            except FileNotFoundError:
                self._require_mark()
                raise MissingBlob(f"there is no blob {name} in {self.address}") from None

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        with self._usable():
            self._require_mark()
            return self._path(name).is_file()

    def names(self) -> Iterator[tuple[str, float]]:
        """All files but the mark, by the time of their last change."""
        with self._usable():
            self._require_mark()
            for path in self._root.glob("*/*/*"):
                yield path.name, path.stat().st_mtime
            for path in (self._root / _PARTIAL).glob("*"):
                yield f"{_PARTIAL}/{path.name}", path.stat().st_mtime

    def delete(self, name: str) -> None:
        """Remove a file."""
        with self._usable():
            self._require_mark()
            self._path(name).unlink(missing_ok=True)

    def mark(self) -> str | None:
        """The content of the mark's file."""
        with self._usable():
            path = self._root / MARK
            return path.read_text(encoding="utf-8") if path.is_file() else None

    def set_mark(self, mark: str) -> None:
        """Make the folder, where it is not there, and the mark in it."""
        with self._usable():
            self._root.mkdir(mode=_FOLDER_MODE, parents=True, exist_ok=True)
            self._write(self._root / MARK, mark.encode())

    def _path(self, name: str) -> Path:
        if name.startswith(f"{_PARTIAL}/"):
            return self._root / name
        return self._root / name[:2] / name[2:4] / name

    def _write(self, path: Path, data: bytes | bytearray) -> None:
        partial = self._root / _PARTIAL
        for folder in (partial, path.parent.parent, path.parent):
            if folder.is_relative_to(self._root):
                _make(folder)
        descriptor, temporary = tempfile.mkstemp(dir=partial)  # its owner's alone
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(descriptor)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        _sync(path.parent)

    def _require_mark(self) -> None:
        if not (self._root / MARK).is_file():
            raise RawStoreUnavailable(
                f"{self.address} is no store of raw records, or its disk is not mounted: it has no file {MARK}"
            )

    @contextmanager
    def _usable(self) -> Iterator[None]:
        """The system's errors as the store's own."""
        try:
            yield
        except OSError as error:
            raise RawStoreUnavailable(
                f"{self.address} cannot be used: {error.strerror or type(error).__name__}"
            ) from error


def _make(folder: Path) -> None:
    """Make a folder, so that a power cut does not take it away with what is in it."""
    try:
        folder.mkdir(mode=_FOLDER_MODE)
    except FileExistsError:
        return
    _sync(folder.parent)


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
