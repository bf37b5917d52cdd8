"""What a store of blobs does, whatever its kind, and how what it gives back is held against its name."""

import hashlib
from collections.abc import Iterable, Iterator
from typing import Protocol

from storage.engine.errors import DamagedData

#: What a store holds beside blobs: the mark of the one database that it belongs to.
MARK = "clutchlife-store"


class BlobStore(Protocol):
    """A store; threads share it. All methods raise RawStoreUnavailable where it is away, full, or has no mark."""

    @property
    def address(self) -> str:
        """Where it is, without anything secret."""

    def put(self, name: str, data: bytes | bytearray) -> None:
        """Store bytes under a name; they are there, whole, when this returns, and at no time in part.

        Again under the same name: they are written again, which mends what was damaged and makes them new to `names`.
        """

    def get(self, name: str) -> bytes:
        """The bytes as they are stored. Raises MissingBlob where the store has none of that name."""

    def exists(self, name: str) -> bool:
        """Whether there is one of that name."""

    def names(self) -> Iterator[tuple[str, float]]:
        """Each name with the time of its last `put` [s since 1970], also of what an interrupted one has left."""

    def delete(self, name: str) -> None:
        """Remove one; nothing happens where there is none."""

    def mark(self) -> str | None:
        """What `set_mark` wrote, None in a place that no database has used yet."""

    def set_mark(self, mark: str) -> None:
        """Make the place a store that belongs to the database of that mark."""


def name_of(data: bytes | bytearray) -> str:
    """The name of a blob: the SHA-256 of its bytes, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def fetched(store: BlobStore, name: str) -> bytes:
    """The blob of that name, held against it. Raises DamagedData where it is missing or another."""
    data = store.get(name)
    sha256 = name_of(data)
    if sha256 != name:
        raise DamagedData(f"the blob {name} in {store.address} is damaged: its sha256 is {sha256}")
    return data


def copy_blobs(source: BlobStore, target: BlobStore, names: Iterable[str]) -> int:
    """Copy blobs that the target lacks, each held against its name; how many were copied. May be interrupted and repeated.

    Raises DamagedData where one is missing or damaged in the source.
    """
    copied = 0
    for name in names:
        if not target.exists(name):
            target.put(name, fetched(source, name))
            copied += 1
    return copied
