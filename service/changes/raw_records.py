"""Where long raw records are kept: chosen, moved, and what no run names any more removed. Safe beside running services."""

import secrets
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

from storage import raw_columns
from storage.blobs import raw_stores
from storage.blobs.raw_stores import RawStore
from storage.blobs.stores import DATABASE, BlobStore, name_of, normal_address, open_store
from storage.engine.database import Database

#: Names that are looked up, and removed, at a time. Chosen: some ten milliseconds of the write lock.
_BATCH = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class Collected:
    """The result of cleaning up a store: the numbers of blobs named by runs, of unnamed blobs too new to remove, and of
    removed blobs."""

    address: str
    named: int
    new: int
    removed: int


def use(database: Database, address: str | None) -> None:
    """Store long columns of new runs at that address from now on; columns already stored stay in place.

    None changes nothing. The store is marked as this database's, because blobs not named here are removed from it.
    Raises ValueError on an address of no kind or another database's store, RawStoreUnavailable if it cannot be reached.
    """
    if address is None:
        return
    address = normal_address(address)
    with database.reading() as connection:
        used = raw_stores.in_use(connection)
    if address == (DATABASE if used is None else used.address):
        return
    if address != DATABASE:
        _claim(database, address)
    with database.writing() as connection:
        raw_stores.use(connection, None if address == DATABASE else address)


def relocate(database: Database, address: str, to: str) -> int:
    """Record that a store's blobs, already copied, are now at another address; returns their number.

    Nothing changes, and ValueError is raised, where the store is unknown, a blob is missing at the new address, the copy is
    another database's, or a run came meanwhile.
    """
    with database.reading() as connection:
        stores = {store.address: store for store in raw_stores.all_of(connection)}
    address = normal_address(address)
    if address not in stores:
        addresses = ", ".join(stores) or "none"
        raise ValueError(f"no raw records were ever kept in {address}; known are: {addresses}")
    store = stores[address]
    target = open_store(normal_address(to))
    count = 0
    for name in _named(database, store):
        count += 1
        if not target.exists(name):
            raise ValueError(
                f"{target.address} lacks the raw record {name}: copy all files from {store.address} to it first"
            )
    if target.mark() != store.mark:
        raise ValueError(f"{target.address} is not a copy of {store.address}, but belongs to another database")
    with database.writing() as connection:
        _, named = raw_stores.numbers(connection).get(store.address, (0, 0))
        if named != count:
            raise ValueError(f"a run arrived during the check: copy all files from {store.address} again")
        raw_stores.set_address(connection, store.store_key, target.address)
    return count


def move(database: Database, to: str, *, tell: Callable[[int], None]) -> int:
    """Use the store at that address and move all long columns there; returns their number. `tell` is called for each.

    An interrupted move continues at the next call; all columns can be read at any time. The copies left in former
    stores are removed by `collect`. Raises the errors of `use`, and DamagedData if a column is damaged.
    """
    use(database, to)
    address = normal_address(to)
    moved, after = 0, (-1, "")
    while True:
        with database.reading() as connection:
            store = raw_stores.in_use(connection) if address != DATABASE else None
            left = raw_columns.stored_elsewhere(connection, store, after=after, most=_BATCH)
        for run_key, name in left:
            with database.reading() as connection:
                column = raw_columns.stored(connection, run_key, name)
            data = column.encoded()
            replace(column, data=data, blob=None).require_whole()  # what is damaged stays where it is
            if store is not None:
                open_store(store.address).put(name_of(data), data)
            with database.writing() as connection:
                raw_columns.move(connection, column, data, store)
            moved += 1
            tell(moved)
        if not left:
            return moved
        after = left[-1]


def collect(database: Database, *, grace: float, now: float | None = None) -> list[Collected]:
    """Remove blobs that no run names from every store, if they are older than `grace` [s]: a run being stored has put
    its blobs shortly before its row. Raises RawStoreUnavailable, ValueError if a store has another database's mark."""
    now = time.time() if now is None else now
    with database.reading() as connection:
        stores = raw_stores.all_of(connection)
    return [_collected(database, store, before=now - grace, now=now) for store in stores]


def _collected(database: Database, store: RawStore, *, before: float, now: float) -> Collected:
    """Remove the blobs of a store that no row names and that are older than `before`; how many there were of each kind."""
    opened = open_store(store.address)
    _require_mark(opened, store.mark)
    with database.reading() as connection:
        interrupted = raw_stores.interrupted_removals(connection, store.store_key, before=before)
    _remove(database, opened, store, interrupted, at=now)
    named = new = removed = 0
    listed = opened.names()
    while batch := list(islice(listed, _BATCH)):
        with database.reading() as connection:
            still_named = raw_stores.named(connection, store.store_key, [name for name, _ in batch])
        named += len(still_named)
        left = [(name, put) for name, put in batch if name not in still_named]
        old = [name for name, put in left if put < before]
        new += len(left) - len(old)
        removed += _remove(database, opened, store, old, at=now)
    with database.writing() as connection:
        raw_stores.forget_removals(connection, store.store_key, before=before)
    return Collected(address=store.address, named=named, new=new, removed=removed)


def _remove(database: Database, opened: BlobStore, store: RawStore, names: Sequence[str], *, at: float) -> int:
    """Remove the blobs that no row names; returns their number. The removal is recorded in the database before and
    after."""
    count = 0
    for start in range(0, len(names), _BATCH):
        batch = names[start : start + _BATCH]
        with database.writing() as connection:
            unnamed = raw_stores.mark_removed(connection, store.store_key, batch, at=at)
        for name in unnamed:
            opened.delete(name)
        if unnamed:
            with database.writing() as connection:
                raw_stores.finish_removal(connection, store.store_key, unnamed)
        count += len(unnamed)
    return count


def _claim(database: Database, address: str) -> None:
    """Mark a store as this database's; the mark is first recorded in the database, so that an interrupted start can be
    repeated."""
    store = open_store(address)
    with database.reading() as connection:
        marks = {row.address: row.mark for row in raw_stores.all_of(connection)}
    mark = store.mark()
    if mark is not None and mark != marks.get(address):
        raise ValueError(f"{address} holds the raw records of another database: choose an empty place")
    if address not in marks:
        with database.writing() as connection:
            marks = {row.address: row.mark for row in raw_stores.all_of(connection)}
            if address not in marks:
                marks[address] = secrets.token_hex(16)
                raw_stores.add(connection, address, marks[address])
    if mark is None:
        store.set_mark(marks[address])
        _require_mark(store, marks[address])


def _require_mark(store: BlobStore, mark: str) -> None:
    if store.mark() != mark:
        raise ValueError(f"{store.address} is not marked as this database's: nothing in it was changed")


def _named(database: Database, store: RawStore) -> Iterator[str]:
    """The names of all blobs of a store that rows of the database refer to."""
    after = ""
    while True:
        with database.reading() as connection:
            names = raw_stores.names_in_store(connection, store.store_key, after=after, most=_BATCH)
        yield from names
        if not names:
            return
        after = names[-1]
