"""A database is opened by its address, which says of what kind it is."""

from contextlib import AbstractContextManager

from storage.engine.database import Database
from storage.engine.limits import LOCK_TIMEOUT
from storage.engine.sqlite import service_lock as file_lock
from storage.engine.sqlite.connect import path_of
from storage.engine.sqlite.database import find_file, open_file


def open_database(url: str, *, lock_timeout: float = LOCK_TIMEOUT, serving: bool = False) -> Database:
    """Open `sqlite:///path` (`sqlite:////path` where it is absolute), make the file and run the migrations it lacks.

    `serving`: it is the service itself that opens it, and holds `service_lock`. Raises ValueError on another address, and
    what `open_file` does.
    """
    return open_file(path_of(url), lock_timeout=lock_timeout, serving=serving)


def find_database(url: str, *, lock_timeout: float = LOCK_TIMEOUT) -> Database:
    """Open a database to read it as it is, whatever its revision up to this code's; nothing is made or migrated.

    Raises ValueError and DatabaseTooNew as `open_database` does, StorageUnavailable where there is none.
    """
    return find_file(path_of(url), lock_timeout=lock_timeout)


def database_exists(url: str) -> bool:
    """Whether there is a database at the address. Raises ValueError on an address of no kind."""
    return path_of(url).exists()


def service_lock(url: str) -> AbstractContextManager[None]:
    """Held inside: the lock of the one service that may use the database. Raises ServiceRuns where another holds it."""
    return file_lock.service_lock(path_of(url))
