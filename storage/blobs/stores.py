"""A store of blobs: what every kind does, a folder, a bucket that speaks S3, and the one that an address names.

A folder holds FOLDER/ab/cd/abcd..., readable for its owner alone. A file is written under another name, synced and then
renamed, so that a crash or a power cut leaves it whole or not at all. In a bucket a request that is answered has stored the
whole object or nothing; S3 is consistent when it is read after that
(https://docs.aws.amazon.com/AmazonS3/latest/userguide/Welcome.html#ConsistencyModel); credentials, region and endpoint are
those of the environment (AWS_*). Both hold a mark: a store that is not there is not taken for an empty one, nor written to.
"""

import hashlib
import logging
import os
import re
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TypeVar

from storage.engine.errors import DamagedData, MissingBlob, RawStoreUnavailable

#: What a store holds beside blobs: the mark of the one database that it belongs to.
MARK = "clutchlife-store"


class BlobStore(ABC):
    """A store of blobs by name, shared by threads. All methods raise RawStoreUnavailable if it is away, full, or has no
    mark.

    `address`: its address without secrets; `missing`: another possible cause if it has no mark.
    """

    address: str
    missing: str

    @abstractmethod
    def put(self, name: str, data: bytes | bytearray) -> None:
        """Store bytes under a name; they are complete when this returns, and never visible in part.

        Storing a name again writes its bytes again, which repairs damage and makes it new for `names`.
        """

    def get(self, name: str) -> bytes:
        """The stored bytes. Raises MissingBlob if the store has none of that name."""
        data = self.read(name)
        if data is None:
            self.require_mark()
            raise MissingBlob(f"the raw record {name} is missing in {self.address}. Restore this file from a backup")
        return data

    @abstractmethod
    def read(self, name: str) -> bytes | None:
        """The bytes of a blob or of the mark; None if there are none, even if the place is no store."""

    @abstractmethod
    def exists(self, name: str) -> bool:
        """Whether the store has a blob of that name."""

    @abstractmethod
    def names(self) -> Iterator[tuple[str, float]]:
        """Each name with the time of its last `put` [s since 1970], including the remains of interrupted ones."""

    @abstractmethod
    def delete(self, name: str) -> None:
        """Remove a blob, if there is one of that name."""

    def mark(self) -> str | None:
        """The mark written by `set_mark`, None in a place that no database has used yet."""
        data = self.read(MARK)
        return None if data is None else data.decode()

    @abstractmethod
    def set_mark(self, mark: str) -> None:
        """Make the place a store, and mark it as the database's."""

    def require_mark(self) -> None:
        """Raise RawStoreUnavailable if the place has no mark."""
        if self.read(MARK) is None:
            raise RawStoreUnavailable(
                f"{self.address} is no store of raw records: the file {MARK} is missing. {self.missing}"
            )


def name_of(data: bytes | bytearray) -> str:
    """The name of a blob: the SHA-256 of its bytes, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def fetched(store: BlobStore, name: str) -> bytes:
    """The blob of that name, verified by its hash. Raises DamagedData if it is missing or different."""
    data = store.get(name)
    sha256 = name_of(data)
    if sha256 != name:
        raise DamagedData(
            f"the raw record {name} in {store.address} is damaged: the sha256 of its content is {sha256}, and must be its "
            "name. Restore this file from a backup"
        )
    return data


_FOLDER_MODE = 0o700
#: Where files are until they are whole; what is left there was interrupted.
_PARTIAL = "partial"


class FolderStore(BlobStore):
    """A store in a folder. Made by `opening`."""

    missing = "Is its disk mounted?"

    def __init__(self, root: Path) -> None:
        self._root = root
        self.address = f"folder://{root}"

    def put(self, name: str, data: bytes | bytearray) -> None:
        with self._usable():
            self.require_mark()
            self._write(self._path(name), data)

    def read(self, name: str) -> bytes | None:
        with self._usable(), suppress(FileNotFoundError, NotADirectoryError):
            return self._path(name).read_bytes()
        return None

    def exists(self, name: str) -> bool:
        with self._usable():
            self.require_mark()
            return self._path(name).is_file()

    def names(self) -> Iterator[tuple[str, float]]:
        with self._usable():
            self.require_mark()
            for path in self._root.glob("*/*/*"):
                yield path.name, path.stat().st_mtime
            for path in (self._root / _PARTIAL).glob("*"):
                yield f"{_PARTIAL}/{path.name}", path.stat().st_mtime

    def delete(self, name: str) -> None:
        with self._usable():
            self.require_mark()
            self._path(name).unlink(missing_ok=True)

    def set_mark(self, mark: str) -> None:
        """Create the folder, if missing, and the mark in it."""
        with self._usable():
            self._root.mkdir(mode=_FOLDER_MODE, parents=True, exist_ok=True)
            self._write(self._root / MARK, mark.encode())

    def _path(self, name: str) -> Path:
        if name == MARK or name.startswith(f"{_PARTIAL}/"):
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

    @contextmanager
    def _usable(self) -> Iterator[None]:
        """Context that raises the system's errors as RawStoreUnavailable."""
        try:
            yield
        except OSError as error:
            raise RawStoreUnavailable(
                f"{self.address} cannot be used: {error.strerror or type(error).__name__}"
            ) from error


def _make(folder: Path) -> None:
    """Create a folder durably, so that a power cut does not remove it."""
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


#: Seconds until a connection stands, and until a request is answered (1 GiB at 10 MB/s); how often and how long [s] one that
#: failed is repeated, so that a post is answered within some ten seconds. Chosen; no table.
_CONNECT_SECONDS, _REQUEST_SECONDS = 3, 110
_RETRIES, _RETRY_SECONDS = 2, 6

_log = logging.getLogger("clutchlife")
_Answer = TypeVar("_Answer")


class ObjectStore(BlobStore):
    """A store in an object-storage bucket, or below a prefix in it. Made by `opening`; RawStoreUnavailable if no client
    is installed."""

    missing = "Does this bucket exist?"

    def __init__(self, bucket: str, prefix: str) -> None:
        if find_spec("obstore") is None:
            raise RawStoreUnavailable(
                f"raw records in s3://{bucket} need a client that is not installed: install clutchlife[objects]"
            )
        from obstore.store import S3Store  # start-up time, optional package

        self.address = f"s3://{bucket}/{prefix}".rstrip("/")
        endpoint = os.environ.get("AWS_ENDPOINT_URL_S3", os.environ.get("AWS_ENDPOINT_URL", ""))
        self._store = S3Store(
            bucket,
            prefix=prefix or None,
            client_options={
                "allow_http": endpoint.startswith("http://"),
                "connect_timeout": f"{_CONNECT_SECONDS}s",
                "timeout": f"{_REQUEST_SECONDS}s",
            },
            retry_config={"max_retries": _RETRIES, "retry_timeout": timedelta(seconds=_RETRY_SECONDS)},
        )

    def put(self, name: str, data: bytes | bytearray) -> None:
        self._request(lambda: self._store.put(name, bytes(data), use_multipart=False))

    def read(self, name: str) -> bytes | None:
        try:
            return bytes(self._request(lambda: self._store.get(name).bytes(), absent=True))
        except FileNotFoundError:
            return None

    def exists(self, name: str) -> bool:
        try:
            self._request(lambda: self._store.head(name), absent=True)
        except FileNotFoundError:
            self.require_mark()
            return False
        return True

    def names(self) -> Iterator[tuple[str, float]]:
        pages = iter(self._store.list())
        while (page := self._request(lambda: next(pages, None))) is not None:
            for item in page:
                if item["path"] != MARK:
                    yield item["path"], item["last_modified"].timestamp()

    def delete(self, name: str) -> None:
        self._request(lambda: self._store.delete(name))

    def set_mark(self, mark: str) -> None:
        """Store the mark's object; the bucket must exist."""
        self.put(MARK, mark.encode())

    def _request(self, request: Callable[[], _Answer], *, absent: bool = False) -> _Answer:
        """The request's result; the client's errors are raised as RawStoreUnavailable, except `absent` objects if these
        are expected.

        What the client says may be long: the log has it, the error one line.
        """
        from obstore.exceptions import (  # start-up time, optional package
            BaseError,
            PermissionDeniedError,
            UnauthenticatedError,
        )

        try:
            return request()
        except FileNotFoundError as error:
            if absent:
                raise
            raise RawStoreUnavailable(f"{self.address} cannot be used: there is no such bucket") from error
        except (PermissionDeniedError, UnauthenticatedError) as error:
            raise RawStoreUnavailable(f"{self.address} cannot be used: it refuses these credentials") from error
        except (BaseError, OSError) as error:
            _log.warning("%s: %s", self.address, " ".join(str(error).split())[:1000])
            raise RawStoreUnavailable(f"{self.address} cannot be used: it does not answer as a store does") from error


#: The address that names no store: raw records are in the database.
DATABASE = "database"

_FOLDER = re.compile(r"folder://(/.+)")
_BUCKET = re.compile(r"s3://([a-z0-9][a-z0-9.-]{1,61}[a-z0-9])(?:/([A-Za-z0-9._/-]*))?")
#: Stores that a process keeps open; one is in use, and another while records move.
_MAX_OPEN = 8


def normal_address(address: str) -> str:
    """The address in its one canonical form. Raises ValueError, without the address, which may hold a secret."""
    if address == DATABASE:
        return address
    folder, bucket = _FOLDER.fullmatch(address), _BUCKET.fullmatch(address)
    if folder:
        return f"folder://{Path(folder[1])}"
    if bucket:
        return f"s3://{bucket[1]}/{(bucket[2] or '').strip('/')}".rstrip("/")
    raise ValueError(
        "the place of raw records must be `database`, `folder:///absolute/path` or `s3://bucket/prefix`. "
        "Set credentials and endpoint with AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_ENDPOINT_URL"
    )


@lru_cache(_MAX_OPEN)
def open_store(address: str) -> BlobStore:
    """The store at an address. Raises ValueError as `normal_address`, RawStoreUnavailable where its client is missing."""
    address = normal_address(address)
    if folder := _FOLDER.fullmatch(address):
        return FolderStore(Path(folder[1]))
    if bucket := _BUCKET.fullmatch(address):
        return ObjectStore(bucket[1], (bucket[2] or "").strip("/"))
    raise ValueError("the database itself is no store of blobs")
