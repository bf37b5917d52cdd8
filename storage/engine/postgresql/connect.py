"""How the server is reached: the address, and the settings of every connection.

Source: https://docs.sqlalchemy.org/en/20/dialects/postgresql.html (psycopg),
https://www.postgresql.org/docs/current/runtime-config-client.html.
"""

from typing import Any

from sqlalchemy import URL, Engine, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError
from sqlalchemy.pool import ConnectionPoolEntry

from storage.engine.errors import StorageUnavailable

SCHEME = "postgresql+psycopg"
#: Connections that a process keeps, and how many more it makes for a while. Chosen: a service's threads seldom ask at once,
#: and with its eight other processes it stays well under the 100 connections that a server has by default.
_KEPT, _MORE = 4, 12
#: What libpq is told where the address does not say: how long [s] a connection may take to be made, after how long [ms] a
#: server whose machine is lost counts as gone, and how often [s] one that says nothing is asked. Chosen; no table.
_CONNECTION = {
    "connect_timeout": 10,
    "keepalives_idle": 30,
    "keepalives_interval": 10,
    "tcp_user_timeout": 60_000,
}
#: Settings of every session. Where the machine of a writer is lost, the server notices within a minute and ends its
#: transaction, and with it the lock. What is acknowledged is on the disk, unless a server promises more (replicas).
_SESSION = """
SELECT set_config('lock_timeout', '{lock_timeout:d}', false),
       set_config('tcp_keepalives_idle', '30', false),
       set_config('tcp_keepalives_interval', '10', false),
       set_config('tcp_keepalives_count', '3', false),
       set_config('tcp_user_timeout', '60000', false),
       CASE WHEN current_setting('synchronous_commit') = 'off' THEN set_config('synchronous_commit', 'on', false) END
"""


def is_on_server(url: str) -> bool:
    """Whether an address is that of a database on a server, not of a file."""
    return url.startswith(f"{SCHEME}://")


def address_of(url: str) -> URL:
    """The address in its parts; ValueError, which says nothing of a password, where a part is missing or wrong."""
    try:
        address = make_url(url)
    except (ArgumentError, ValueError):
        raise ValueError(f"the database must be given as {SCHEME}://user@host/database") from None
    if "@" in (address.host or ""):
        raise ValueError("an @ in a password must be written as %40 in the database's address")
    if not address.database:
        raise ValueError(f"the database needs a name, as in {SCHEME}://user@host/database")
    return address


def shown(address: URL) -> str:
    """The address as logs and errors may show it: without the password and the options, one of which may be a password."""
    place = address.host or "local socket"
    return f"PostgreSQL database {address.database} ({place}{'' if address.port is None else f':{address.port}'})"


def make_engine(address: URL, lock_timeout: float) -> Engine:
    """An engine on the database. Raises StorageUnavailable where the driver is not installed."""
    # a server that was started again has ended the connections that were kept
    return _engine(address, lock_timeout, pool_size=_KEPT, max_overflow=_MORE, pool_pre_ping=True)


def make_autocommit_engine(address: URL, lock_timeout: float, *, connections: int) -> Engine:
    """An engine for single statements, by so many connections, which are kept: no transaction, and no look at whether a
    connection is still there, each of which would be a way to the server and back."""
    return _engine(address, lock_timeout, pool_size=connections, max_overflow=0, isolation_level="AUTOCOMMIT")


def _engine(address: URL, lock_timeout: float, **options: Any) -> Engine:
    unsaid = {name: value for name, value in _CONNECTION.items() if name not in address.query}
    try:
        engine = create_engine(address, connect_args=unsaid, pool_timeout=lock_timeout, **options)
    except ModuleNotFoundError as error:
        raise StorageUnavailable("PostgreSQL needs a driver: pip install clutchlife[postgresql]") from error
    session = _SESSION.format(lock_timeout=max(1, round(1000 * lock_timeout)))

    @event.listens_for(engine, "connect")
    def prepare(connection: Any, _: ConnectionPoolEntry) -> None:
        connection.execute(session)
        connection.commit()

    return engine
