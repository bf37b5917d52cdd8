"""The stores that hold raw records beside the database, which of them is in use, and which of their blobs are removed.

A blob is put into its store before the row that names it is written, and may be the same as one that nothing names and that
is being removed. So what is removed is noted first, by number: who has put a blob looks, in the transaction that names it,
for a removal of that name since before it was put (`are_kept`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, and_, delete, func, or_, select, update

from storage.dialects import among, upsert
from storage.encoding import Rows
from storage.tables import IN_A_STORE, channel, raw_removal, raw_store


@dataclass(frozen=True, slots=True, kw_only=True)
class RawStore:
    """A store by its address; `mark` is this database's, `removals` how many batches were removed from it."""

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
    """Whether a removal is of one of the names in the store."""
    return and_(raw_removal.c.store_key == store_key, among(raw_removal.c.blob, list(names)))


def all_of(connection: Connection) -> list[RawStore]:
    """All stores that ever were in use, the first first."""
    return _rows.all(connection.execute(select(raw_store).order_by(raw_store.c.store_key)))


def in_use(connection: Connection) -> RawStore | None:
    """The store that long columns of new runs go to, None where they go into the database."""
    return _rows.first(connection.execute(select(raw_store).where(raw_store.c.in_use == 1)))


def add(connection: Connection, address: str, mark: str) -> None:
    """A store that is not in use yet. Raises IntegrityError where its address is known."""
    connection.execute(raw_store.insert(), {"address": address, "mark": mark})


def use(connection: Connection, address: str | None) -> None:
    """Have new runs go to the store of that address, into the database where it is None."""
    connection.execute(update(raw_store).values(in_use=0))
    if address is not None:
        connection.execute(update(raw_store).where(raw_store.c.address == address).values(in_use=1))


def set_address(connection: Connection, store_key: int, address: str) -> None:
    """Look for a store's blobs at another address. Raises IntegrityError where that is known."""
    connection.execute(update(raw_store).where(raw_store.c.store_key == store_key).values(address=address))


def numbers(connection: Connection) -> dict[str, tuple[int, int]]:
    """address -> how many columns are there, and how many blobs they are."""
    return {address: (columns, blobs) for address, columns, blobs in connection.execute(_numbers)}


def named(connection: Connection, store_key: int, names: Iterable[str]) -> set[str]:
    """The subset of the names that rows use in the store."""
    query = select(channel.c.blob).where(channel.c.store_key == store_key, among(channel.c.blob, list(names)))
    return set(connection.execute(query.where(IN_A_STORE).distinct()).scalars())


def names_in_store(connection: Connection, store_key: int, *, after: str, most: int) -> list[str]:
    """The names that rows have in the store, in order, at most so many behind `after`."""
    query = select(channel.c.blob).where(channel.c.store_key == store_key, IN_A_STORE, channel.c.blob > after)
    return list(connection.execute(query.distinct().order_by(channel.c.blob).limit(most)).scalars())


def mark_removed(connection: Connection, store_key: int, names: Sequence[str], *, at: float) -> list[str]:
    """Note that those of the names which no row has are being removed from `at` on [s since 1970]; which these are."""
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
    """Note that these have been removed."""
    connection.execute(update(raw_removal).where(_of_names(store_key, names)).values(finished=1))


def interrupted_removals(connection: Connection, store_key: int, *, before: float) -> list[str]:
    """Names whose removal began before that time [s since 1970] and was not finished."""
    begun = (raw_removal.c.store_key == store_key, raw_removal.c.finished == 0, raw_removal.c.at < before)
    return list(connection.execute(select(raw_removal.c.blob).where(*begun)).scalars())


def forget_removals(connection: Connection, store_key: int, *, before: float) -> None:
    """Forget finished removals from before that time [s since 1970], which no run on its way can be hit by any more."""
    ended = (raw_removal.c.store_key == store_key, raw_removal.c.finished == 1, raw_removal.c.at < before)
    connection.execute(delete(raw_removal).where(*ended))


def are_kept(connection: Connection, store: RawStore, names: Iterable[str]) -> bool:
    """Whether what was put into the store since `store` was read is there: not removed, nor the store at another address."""
    since = or_(raw_removal.c.finished == 0, raw_removal.c.number > store.removals)
    removed = select(func.count()).select_from(raw_removal).where(_of_names(store.store_key, names), since)
    address = select(raw_store.c.address).where(raw_store.c.store_key == store.store_key)
    return not connection.execute(removed).scalar_one() and connection.execute(address).scalar_one() == store.address
