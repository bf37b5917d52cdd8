"""The stores that hold raw records beside the database, which of them is in use, and which of their blobs are removed.

A blob is put into its store before the row that names it is written, and may be the same as one that nothing names and that
is being removed. So what is removed is noted first, by number: who has put a blob looks, in the transaction that names it,
for a removal of that name since before it was put (`are_kept`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, and_, delete, func, or_, select, update

from storage.dialects import among
from storage.rows import Rows, upsert
from storage.tables import IN_A_STORE, channel, raw_removal, raw_store


@dataclass(frozen=True, slots=True, kw_only=True)
class RawStore:
    """A store of raw records by its address; `mark` is this database's mark in it, `removals` the number of removed
    batches."""

    store_key: int
    address: str
    mark: str
    in_use: bool
    removals: int


_rows = Rows(RawStore)
_numbers = (
    select(raw_store.c.address, func.count(), func.count(channel.c.blob.distinct()))
    .join(channel, channel.c.store_key == raw_store.c.store_key)
    .where(channel.c.blob.is_not(None))
    .group_by(raw_store.c.address)
    .order_by(raw_store.c.address)
)


def _of_names(store_key: int, names: Iterable[str]) -> ColumnElement[bool]:
    """The condition that a removal is of one of the names in the store."""
    return and_(raw_removal.c.store_key == store_key, among(raw_removal.c.blob, list(names)))


def all_of(connection: Connection) -> list[RawStore]:
    """All stores ever in use, oldest first."""
    return _rows.all(connection.execute(select(raw_store).order_by(raw_store.c.store_key)))


def in_use(connection: Connection) -> RawStore | None:
    """The store for long columns of new runs, None if they are stored in the database."""
    return _rows.first(connection.execute(select(raw_store).where(raw_store.c.in_use == 1)))


def add(connection: Connection, address: str, mark: str) -> None:
    """Add a store that is not in use yet. Raises IntegrityError where its address is known."""
    connection.execute(raw_store.insert(), {"address": address, "mark": mark})


def use(connection: Connection, address: str | None) -> None:
    """Store long columns of new runs in the store at that address, None: in the database."""
    connection.execute(update(raw_store).values(in_use=0))
    if address is not None:
        connection.execute(update(raw_store).where(raw_store.c.address == address).values(in_use=1))


def set_address(connection: Connection, store_key: int, address: str) -> None:
    """Change a store's address. Raises IntegrityError where that is known."""
    connection.execute(update(raw_store).where(raw_store.c.store_key == store_key).values(address=address))


def numbers(connection: Connection) -> dict[str, tuple[int, int]]:
    """address -> the numbers of columns and of blobs there."""
    return {address: (columns, blobs) for address, columns, blobs in connection.execute(_numbers)}


def named(connection: Connection, store_key: int, names: Iterable[str]) -> set[str]:
    """Those of the names that rows use in the store."""
    query = select(channel.c.blob).where(channel.c.store_key == store_key, among(channel.c.blob, list(names)))
    return set(connection.execute(query.where(IN_A_STORE).distinct()).scalars())


def names_in_store(connection: Connection, store_key: int, *, after: str, most: int) -> list[str]:
    """The names that rows use in the store, in order, at most `most` after the name `after`."""
    query = select(channel.c.blob).where(channel.c.store_key == store_key, IN_A_STORE, channel.c.blob > after)
    return list(connection.execute(query.distinct().order_by(channel.c.blob).limit(most)).scalars())


def mark_removed(connection: Connection, store_key: int, names: Sequence[str], *, at: float) -> list[str]:
    """Record that the removal of the names used by no row begins at `at` [s since 1970]; returns these names."""
    still_named = named(connection, store_key, names)
    unnamed = [name for name in names if name not in still_named]
    if unnamed:
        store = raw_store.c.store_key == store_key
        connection.execute(update(raw_store).where(store).values(removals=raw_store.c.removals + 1))
        number = connection.execute(select(raw_store.c.removals).where(store)).scalar_one()
        row = {"store_key": store_key, "number": number, "at": at, "finished": 0}
        upsert(connection, raw_removal, [row | {"blob": name} for name in unnamed])
    return unnamed


def finish_removal(connection: Connection, store_key: int, names: Sequence[str]) -> None:
    """Record that these names have been removed."""
    connection.execute(update(raw_removal).where(_of_names(store_key, names)).values(finished=1))


def interrupted_removals(connection: Connection, store_key: int, *, before: float) -> list[str]:
    """The names with a removal begun before that time [s since 1970] and not finished."""
    begun = (raw_removal.c.store_key == store_key, raw_removal.c.finished == 0, raw_removal.c.at < before)
    return list(connection.execute(select(raw_removal.c.blob).where(*begun)).scalars())


def forget_removals(connection: Connection, store_key: int, *, before: float) -> None:
    """Delete the records of removals finished before that time [s since 1970], which no run being stored can conflict
    with."""
    ended = (raw_removal.c.store_key == store_key, raw_removal.c.finished == 1, raw_removal.c.at < before)
    connection.execute(delete(raw_removal).where(*ended))


def are_kept(connection: Connection, store: RawStore, names: Iterable[str]) -> bool:
    """Whether blobs put into the store since `store` was read are still found: none removed, and the address unchanged."""
    since = or_(raw_removal.c.finished == 0, raw_removal.c.number > store.removals)
    removed = select(func.count()).select_from(raw_removal).where(_of_names(store.store_key, names), since)
    address = select(raw_store.c.address).where(raw_store.c.store_key == store.store_key)
    return not connection.execute(removed).scalar_one() and connection.execute(address).scalar_one() == store.address
