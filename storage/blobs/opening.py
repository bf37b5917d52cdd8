"""A store is opened by its address, which says of what kind it is: `folder:///path`, or `s3://bucket/prefix`."""

import re
from functools import lru_cache
from pathlib import Path

from storage.blobs.folder import FolderStore
from storage.blobs.objects import ObjectStore
from storage.blobs.store import BlobStore

#: The address that names no store: raw records are in the database.
DATABASE = "database"

_FOLDER = re.compile(r"folder://(/.+)")
_BUCKET = re.compile(r"s3://([a-z0-9][a-z0-9.-]{1,61}[a-z0-9])(?:/([A-Za-z0-9._/-]*))?")
#: Stores that a process keeps open; one is in use, and another while records move.
_MOST_OPEN = 8


def normal_address(address: str) -> str:
    """The one way in which an address is written. Raises ValueError, without the address, which may hold a secret."""
    if address == DATABASE:
        return address
    folder, bucket = _FOLDER.fullmatch(address), _BUCKET.fullmatch(address)
    if folder:
        return f"folder://{Path(folder[1])}"
    if bucket:
        return f"s3://{bucket[1]}/{(bucket[2] or '').strip('/')}".rstrip("/")
    raise ValueError(
        "raw records are kept in `database`, `folder:///absolute/path` or `s3://bucket/prefix` (credentials and endpoint "
        "are taken from AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_ENDPOINT_URL): the address is none of them"
    )


@lru_cache(_MOST_OPEN)
def open_store(address: str) -> BlobStore:
    """The store at an address. Raises ValueError as `normal_address`, RawStoreUnavailable where its client is missing."""
    address = normal_address(address)
    if folder := _FOLDER.fullmatch(address):
        return FolderStore(Path(folder[1]))
    if bucket := _BUCKET.fullmatch(address):
        return ObjectStore(bucket[1], (bucket[2] or "").strip("/"))
    raise ValueError("the database itself is no store of blobs")
