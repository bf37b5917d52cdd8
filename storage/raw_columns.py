"""The tables of raw channels, kept bit for bit, and of the files from which they were read.

They are written once; only the channels of a run whose file is read again by another rig profile are replaced. A long
column may lie in a store beside the database (`storage/blobs`): put there before the row that names it, and fetched when
no transaction is open any more.
"""

import hashlib
import zlib
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import ColumnElement, Connection, and_, delete, func, or_, select, tuple_, update

from storage.blobs import raw_stores
from storage.blobs.raw_stores import RawStore
from storage.blobs.stores import fetched, name_of, open_store
from storage.encoding import CODEC, DECIMAL_CODEC, LONG, decode, decode_decimals, encode, encode_decimals
from storage.engine.errors import DamagedData, DatabaseBusy
from storage.tables import channel, raw_store, run

#: Bytes of an encoded column that stay in the database wherever raw records go. Chosen: docs/appendix/benchmarks.md: a store
#: adds 20 to 45 ms to a column of any length. Some 10,000 samples are longer.
MAX_INLINE = 64 << 10
#: The name under which a run's file stands among its channels; no channel has it.
FILE = "@file"
#: How a file is kept: deflated, or as it was sent where that is hardly shorter (it is packed already).
_DEFLATED, _AS_SENT = "zlib", "as-sent"
#: Level of deflating, and bytes at a time. Chosen: of a CSV of 700,000 rows (25 MB) level 1 leaves 38 % in 1.0 s, level 3
#: 33 % in 1.6 s, level 6 28 % in 6.2 s, and the sender waits for it.
_FILE_LEVEL, _FILE_BLOCK = 1, 1 << 20
#: Packed over plain bytes from which a file is kept as it was sent. Chosen; no table.
_HARDLY_SHORTER = 0.95

_columns = select(
    channel.c.name, channel.c.codec, channel.c.length, channel.c.data, channel.c.blob, raw_store.c.address
).select_from(channel.outerjoin(raw_store, raw_store.c.store_key == channel.c.store_key))


@dataclass(frozen=True, slots=True)
class Encoded:
    """The encoded channels of one run in order: name, codec, length and bytes of each; and by name the blobs of
    channels put into a store, whose bytes are empty here."""

    columns: tuple[tuple[str, str, int, bytearray], ...]
    store: RawStore | None = None
    blobs: Mapping[str, str] | None = None

    @property
    def is_long(self) -> bool:
        """Whether a column is long enough for a store of raw records."""
        return any(len(data) > MAX_INLINE for *_, data in self.columns)

    def put(self, store: RawStore) -> "Encoded":
        """Put the long columns into the store; `store` must have been read before. Raises RawStoreUnavailable."""
        opened = open_store(store.address)
        long = {name: data for name, _, _, data in self.columns if len(data) > MAX_INLINE}
        blobs = {name: name_of(data) for name, data in long.items()}
        with ThreadPoolExecutor(max(len(long), 1)) as pool:  # a store is waited for, it takes no time of the processor
            list(pool.map(opened.put, blobs.values(), long.values()))
        columns = tuple((*column[:3], bytearray() if column[0] in blobs else column[3]) for column in self.columns)
        return replace(self, columns=columns, store=store, blobs=blobs)


@dataclass(frozen=True, slots=True)
class PackedFile:
    """A file in its stored form, with the hash and length [bytes] of the original."""

    sha256: str
    length: int
    codec: str
    data: bytearray


def packed(path: Path) -> PackedFile:
    """A file read and deflated, block by block."""
    digest, deflating, data, length = hashlib.sha256(), zlib.compressobj(_FILE_LEVEL), bytearray(), 0
    with path.open("rb") as file:
        while block := file.read(_FILE_BLOCK):
            digest.update(block)
            data += deflating.compress(block)
            length += len(block)
    data += deflating.flush()
    codec = _DEFLATED
    if len(data) > _HARDLY_SHORTER * length:
        codec, data = _AS_SENT, bytearray(path.read_bytes())
    return PackedFile(sha256=digest.hexdigest(), length=length, codec=codec, data=data)


def encoded(channels: Mapping[str, NDArray[np.float64]], file: PackedFile | None = None) -> Encoded:
    """The channels [n] of a run, and its file, encoded. Slow for long records; needs no connection."""
    columns = tuple((name, *_encoded(column)) for name, column in channels.items())
    return Encoded(columns if file is None else (*columns, (FILE, file.codec, file.length, file.data)))


def _encoded(column: NDArray[np.float64]) -> tuple[str, int, bytearray]:
    decimals = encode_decimals(column) if column.size >= LONG else None
    if decimals is not None:
        return DECIMAL_CODEC, column.size, decimals
    return CODEC, column.size, encode(column)


def write(connection: Connection, run_key: int, channels: Encoded) -> None:
    """Store the channels of a run. Raises IntegrityError where the run has them already, DatabaseBusy where a blob of
    it, put meanwhile, may have been removed with what nothing named: it is to be put again."""
    store, blobs = channels.store, channels.blobs or {}
    if store is not None:
        _refuse_removed(connection, store, blobs.values())
    rows = [
        {
            "run_key": run_key,
            "name": name,
            "position": position,
            "codec": codec,
            "length": length,
            "data": data,
            "store_key": store.store_key if store is not None and name in blobs else None,
            "blob": blobs.get(name),
        }
        for position, (name, codec, length, data) in enumerate(channels.columns)
    ]
    if rows:
        connection.execute(channel.insert(), rows)


def rewrite(connection: Connection, run_key: int, channels: Encoded) -> None:
    """Replace a run's channels; its file stays. Raises DatabaseBusy as `write` does."""
    connection.execute(delete(channel).where(channel.c.run_key == run_key, channel.c.name != FILE))
    write(connection, run_key, channels)


@dataclass(frozen=True, slots=True)
class Stored:
    """One stored channel of a run, to be read and decoded after the transaction: its bytes, or the name of its blob and
    its store's address."""

    run_key: int
    name: str
    codec: str
    length: int
    data: bytes
    blob: str | None = None
    address: str | None = None

    def encoded(self) -> bytes:
        """The encoded bytes, read from the store if they are there. Raises as `values` does."""
        if self.blob is None or self.address is None:
            return self.data
        return fetched(open_store(self.address), self.blob)

    def loaded(self) -> "Stored":
        """The channel with its bytes in memory, so that another process needs no store. Raises as `values` does."""
        return replace(self, data=self.encoded(), blob=None, address=None)

    def require_whole(self) -> None:
        """Decode the channel to check it, and keep nothing. Raises as `values` does."""
        if self.name == FILE:
            self.copy_to(None)
        else:
            self.values()

    def copy_to(self, target: BinaryIO | None) -> str:
        """Write the original file, block by block, to an open file; returns its sha256. Raises as `values` does."""
        data, digest, length = memoryview(self.encoded()), hashlib.sha256(), 0
        inflating = zlib.decompressobj() if self.codec == _DEFLATED else None
        try:
            for start in range(0, len(data), _FILE_BLOCK):
                block: bytes | memoryview = data[start : start + _FILE_BLOCK]
                if inflating is not None:
                    block = inflating.decompress(block)
                digest.update(block)
                length += len(block)
                if target is not None:
                    target.write(block)
        except zlib.error as error:
            raise DamagedData(f"the file: {error}") from error
        if length != self.length:
            raise DamagedData(f"the file has {length} bytes, {self.length} were sent")
        return digest.hexdigest()

    def values(self) -> NDArray[np.float64]:
        """The decoded channel [length]. Raises DamagedData, and RawStoreUnavailable if the store cannot be reached."""
        try:
            data = self.encoded()
            if self.codec == DECIMAL_CODEC:
                return decode_decimals(data, self.length)
            return decode(data, self.codec, self.length)
        except DamagedData as error:
            raise DamagedData(f"channel {self.name}: {error}") from error


def stored_of_run(connection: Connection, run_key: int) -> list[Stored]:
    """The channels of a run in the order sent, not yet read or decoded; empty for a run without channels."""
    of_run = _columns.where(channel.c.run_key == run_key, channel.c.name != FILE).order_by(channel.c.position)
    return [Stored(run_key, **row._asdict()) for row in connection.execute(of_run)]


def file_of(connection: Connection, run_key: int) -> Stored | None:
    """The file from which a run was read, not yet unpacked; None for a run sent in another way."""
    return _named(connection, run_key, FILE)


def stored(connection: Connection, run_key: int, name: str) -> Stored:
    """One channel of a run, not yet read or decoded. Raises LookupError if the run has no such channel."""
    found = _named(connection, run_key, name)
    if found is None:
        raise LookupError(f"run {run_key} has no channel {name}")
    return found


def _named(connection: Connection, run_key: int, name: str) -> Stored | None:
    row = connection.execute(_columns.where(channel.c.run_key == run_key, channel.c.name == name)).first()
    return None if row is None else Stored(run_key, **row._asdict())


def stored_elsewhere(
    connection: Connection, store: RawStore | None, *, after: tuple[int, str], most: int
) -> list[tuple[int, str]]:
    """(run_key, name) of channels that a move to `store` (None: to the database) has yet to move, in order, after
    `after`: those in other stores and, for a store, long ones in the database."""
    condition: ColumnElement[bool] = channel.c.blob.is_not(None)
    if store is not None:
        long_here = and_(channel.c.blob.is_(None), func.length(channel.c.data) > MAX_INLINE)
        condition = or_(and_(condition, channel.c.store_key != store.store_key), long_here)
    keys = (channel.c.run_key, channel.c.name)
    query = select(*keys).where(tuple_(*keys) > tuple_(*after), condition).order_by(*keys).limit(most)
    return [(run_key, name) for run_key, name in connection.execute(query)]


def move(connection: Connection, column: Stored, data: bytes, store: RawStore | None) -> None:
    """Move a channel to a store that already has its bytes; `store` None: write its bytes into the database.

    Raises DatabaseBusy if a clean-up may have removed the blob meanwhile: then put it again.
    """
    place: dict[str, Any] = {"data": data, "blob": None, "store_key": None}
    if store is not None:
        place = {"data": b"", "blob": name_of(data), "store_key": store.store_key}
        _refuse_removed(connection, store, [place["blob"]])
    this = update(channel).where(channel.c.run_key == column.run_key, channel.c.name == column.name)
    connection.execute(this.values(place))


def _refuse_removed(connection: Connection, store: RawStore, blobs: Iterable[str]) -> None:
    if not raw_stores.are_kept(connection, store, blobs):
        raise DatabaseBusy(
            f"raw records with the same content are being removed from {store.address}, or this store was moved: try again"
        )


def values_of(columns: Sequence[Stored]) -> dict[str, NDArray[np.float64]]:
    """The channels by name, fetched and decoded one after the other. Raises as `Stored.values` does."""
    return {column.name: column.values() for column in columns}


def lengths(connection: Connection, run_key: int) -> dict[str, int]:
    """The number of values of each channel of a run, in the order sent; no values are read."""
    query = select(channel.c.name, channel.c.length).where(channel.c.run_key == run_key, channel.c.name != FILE)
    rows = connection.execute(query.order_by(channel.c.position))
    return {name: length for name, length in rows}  # noqa: C416  (rows are no pairs to mypy)


def samples(connection: Connection, clutch_id: str) -> dict[int, int]:
    """run_key -> number of samples, for a clutch's runs that are sampled records."""
    query = select(channel.c.run_key, channel.c.length).join(run, run.c.run_key == channel.c.run_key)
    rows = connection.execute(query.where(run.c.clutch_id == clutch_id, channel.c.name == "time_s"))
    return {run_key: length for run_key, length in rows}  # noqa: C416  (rows are no pairs to mypy)
