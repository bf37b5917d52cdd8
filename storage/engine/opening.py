"""A database is opened by its address, which says of what kind it is: `sqlite:///path`, or one on a PostgreSQL server."""

from contextlib import AbstractContextManager, nullcontext

from storage.engine.database import LOCK_TIMEOUT, Database
from storage.engine.integrity import refuse_pending
from storage.engine.postgresql.connect import address_of, is_on_server, migration_lock
from storage.engine.postgresql.connect import shown as shown_server
from storage.engine.postgresql.database import find_server, open_server, server_has_tables
from storage.engine.sqlite import connect as file_lock
from storage.engine.sqlite.connect import path_of
from storage.engine.sqlite.database import find_file, open_file


def open_database(url: str, *, lock_timeout: float = LOCK_TIMEOUT, serving: bool = False) -> Database:
    """Open `sqlite:///path` (`sqlite:////path` where it is absolute) or `postgresql+psycopg://user@host/database`.

    The file, or the tables of an empty database, is made, and the migrations that are missing are run.

    `serving`: it is a service that opens it, inside `service_lock`; nobody migrates the database under it.

    Raises ValueError on another address, UnfinishedMigration on the target of a migration that has not ended, and what
    `open_file` and `open_server` do.
    """
    return _opened(url, lock_timeout=lock_timeout, serving=serving).where(refuse_pending)


def open_unfinished(url: str) -> Database:
    """Open a database like `open_database`, also an incomplete target of a migration; call it inside `sole_use`."""
    return _opened(url, lock_timeout=LOCK_TIMEOUT, serving=not is_on_server(url))


def _opened(url: str, *, lock_timeout: float, serving: bool) -> Database:
    if is_on_server(url):
        return open_server(address_of(url), lock_timeout=lock_timeout, serving=serving)
    return open_file(path_of(url), lock_timeout=lock_timeout, serving=serving)


def find_database(url: str) -> Database:
    """Open a database for reading, at its present revision, which may be older than this code's; nothing is created or
    migrated.

    Raises ValueError, DatabaseTooNew and UnfinishedMigration as `open_database` does, and StorageUnavailable where there is
    none.
    """
    if is_on_server(url):
        return find_server(address_of(url)).where(refuse_pending)
    return find_file(path_of(url)).where(refuse_pending)


def database_exists(url: str) -> bool:
    """Whether there is a database at the address.

    Raises ValueError on an unknown kind of address, StorageUnavailable if a server does not answer or has no database
    of that name.
    """
    if is_on_server(url):
        return server_has_tables(address_of(url))
    return path_of(url).exists()


def service_lock(url: str) -> AbstractContextManager[None]:
    """Context that holds the lock of the one service that may use a database file. Raises ServiceRuns if another holds
    it.

    A database on a server may have any number of services; they hold no lock here, but one per connection
    (`open_database(..., serving=True)`).
    """
    if is_on_server(url):
        return nullcontext()
    return file_lock.service_lock(path_of(url))


def sole_use(url: str) -> AbstractContextManager[None]:
    """Context during which no service uses the database or starts to. Raises ServiceRuns if one uses it."""
    return migration_lock(address_of(url), LOCK_TIMEOUT) if is_on_server(url) else service_lock(url)


def shown(url: str) -> str:
    """The address for messages, without a password."""
    return shown_server(address_of(url)) if is_on_server(url) else f"the file {path_of(url).resolve()}"
