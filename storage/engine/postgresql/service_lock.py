"""One service of a database at a time: a lock of the session that takes it, which ends with its connection.

Source: https://www.postgresql.org/docs/current/explicit-locking.html#ADVISORY-LOCKS. Such locks are of one database.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import URL

from storage.engine.errors import ServiceRuns
from storage.engine.limits import LOCK_TIMEOUT
from storage.engine.postgresql.connect import make_engine, shown
from storage.engine.postgresql.driver_errors import translated

#: The keys of the program's locks: "CLUTCH" in ASCII, and a number.
_PROGRAM = int.from_bytes(b"CLUTCH") << 8
WRITE_KEY, SERVICE_KEY = _PROGRAM | 1, _PROGRAM | 2


@contextmanager
def service_lock(address: URL) -> Iterator[None]:
    """Hold the lock of the database inside. Raises ServiceRuns where another holds it."""
    name = shown(address)
    engine = make_engine(address, LOCK_TIMEOUT)
    try:
        with translated(name), engine.execution_options(isolation_level="AUTOCOMMIT").connect() as connection:
            if not connection.exec_driver_sql(f"SELECT pg_try_advisory_lock({SERVICE_KEY})").scalar_one():
                raise ServiceRuns(f"{name}: a service uses this database already: stop it first")
            try:
                yield
            finally:
                connection.invalidate()  # closed with its lock, and not asked before: its server may be gone
    finally:
        engine.dispose()
