"""A database on a server: its transactions, and how its tables come to be.

Writers of one clutch queue for a lock of that clutch, so that its rows are committed in the order of the numbers that they
get (revisions, keys); those of different clutches write at once. Who writes of all clutches together waits for all of them.
`commits`, the number of all, is given last: from then until it is committed a transaction holds that row (`watch`).
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext

from sqlalchemy import URL, Connection, insert, inspect, text
from sqlalchemy.exc import ProgrammingError, SQLAlchemyError

from storage.engine.database import Database
from storage.engine.errors import DatabaseTooOld, StorageError, StorageUnavailable
from storage.engine.integrity import refuse_newer
from storage.engine.postgresql.connect import make_autocommit_engine, make_engine, shown
from storage.engine.postgresql.driver_errors import translated
from storage.engine.postgresql.locks import hold_service_lock, migration_lock, write_lock
from storage.engine.postgresql.server_tables import commits, count_commit, server_tables
from storage.engine.postgresql.shared_answers import ServerAnswers
from storage.engine.postgresql.single_statements import SingleStatements
from storage.engine.postgresql.watch import ServerWatch
from storage.migrations.upgrade import current, head, make_all, upgrade

#: A transaction that changed nothing has no number and is not counted.
_COUNT = count_commit.where(text("pg_current_xact_id_if_assigned() IS NOT NULL"))


class ServerDatabase(Database):
    """An open database on a server. Made by `open_server`."""

    path = None
    journal_mode = None

    def __init__(self, address: URL, *, lock_timeout: float, writable: bool = True, serving: bool = False) -> None:
        self.url = address.render_as_string(hide_password=False)
        self.name = shown(address)
        self._address = address
        self._lock_timeout = lock_timeout
        self._closed = False
        self._engine = make_engine(address, lock_timeout)
        self._readers = self._engine.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
        # a statement of a writer sees what was committed before the lock was free
        self._writers = self._engine.execution_options(
            isolation_level="READ COMMITTED", postgresql_readonly=not writable
        )
        # what every request asks does not wait for connections by which answers are read and written
        watching = make_autocommit_engine(address, lock_timeout, connections=1)
        sharing = make_autocommit_engine(address, lock_timeout, connections=2)
        if serving:
            for engine in (self._engine, watching, sharing):
                hold_service_lock(engine, self.name)
        self._watching, self._sharing = SingleStatements(watching, self.name), SingleStatements(sharing, self.name)
        self.watch = ServerWatch(self._watching)
        self.answers = ServerAnswers(self._sharing)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection that sees one state of the database, that of its first statement, until the block ends."""
        self._refuse_closed()
        with translated(self.name), self._readers.begin() as connection:
            yield connection

    @contextmanager
    def writing(self, *, of: str | None = None) -> Iterator[Connection]:
        """A connection that holds the lock of writers `of` something: committed when the block ends, else rolled back."""
        self._refuse_closed()
        with translated(self.name), self._writers.begin() as connection:
            write_lock(connection, of)
            yield connection
            connection.execute(_COUNT)

    def faults(self, *, least_free: int) -> dict[str, str]:  # noqa: ARG002  (the server's disk is its operator's)
        """What keeps the server from being used; of its disk nothing is known here."""
        if self._closed:
            return {"database": "it has been closed"}
        try:
            with self.reading() as connection:
                revision = current(connection)
                standby = connection.exec_driver_sql("SELECT pg_is_in_recovery()").scalar_one()
        except (StorageError, SQLAlchemyError) as error:
            return {"database": f"the database cannot be read: {type(error).__name__}"}
        if revision != head():
            return {"database": f"the database is at revision {revision}, this release needs {head()}"}
        return {"database": "the server is a standby, which is only read"} if standby else {}

    def damage(self, connection: Connection) -> list[str]:  # noqa: ARG002  (pages are the server's: pg_amcheck)
        """Nothing: the server refuses rows that refer to missing ones, and checks its pages itself."""
        return []

    def close(self) -> None:
        """Close all connections; any later use raises StorageUnavailable. May be called twice."""
        self._closed = True
        self._engine.dispose()
        self.watch.close()
        self._watching.close()
        self._sharing.close()

    def migrate(self) -> None:
        """Make the tables of an empty database, or run the steps that it lacks, not under a running service."""
        with self.reading() as connection:
            _require_utf8(connection, self.name)
            revision = current(connection)
            has_server_tables = set(inspect(connection).get_table_names()) >= set(server_tables.tables)
        if revision == head() and has_server_tables:
            return
        in_use = revision is not None
        with (
            migration_lock(self._address, self._lock_timeout) if in_use else nullcontext(),
            self.writing() as connection,
        ):
            revision = current(connection)  # another process may have been before
            if revision is None:
                make_all(connection)
            elif revision != head():
                refuse_newer(revision)
                upgrade(connection)
            server_tables.create_all(connection)
            if revision is None:
                connection.execute(insert(commits).values(number=0))

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self.name} has been closed")


class FoundServerDatabase(ServerDatabase):
    """A database that is only read, at the revision that it was found at. Made by `find_server`."""

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """As every database's; raises DatabaseTooOld where what is asked for came with a later revision."""
        try:
            with super().reading() as connection:
                yield connection
        except ProgrammingError as error:
            with super().reading() as connection:
                revision = current(connection)
            if revision == head():
                raise
            raise DatabaseTooOld(
                f"{self.name} is at revision {revision}, this needs {head()}: `clutchlife serve` brings it there"
            ) from error


def open_server(address: URL, *, lock_timeout: float, serving: bool = False) -> ServerDatabase:
    """Open a database on a server, make the tables of an empty one and run the migrations that it lacks.

    Raises DatabaseTooNew on that of a newer release, StorageUnavailable where it cannot be used or is not in UTF-8,
    DatabaseBusy where another writes for `lock_timeout` [s], ServiceRuns where it is to be migrated under a service.

    `serving`: it is a service that opens it; from then on until it is closed nobody migrates the database.
    """
    with closing(ServerDatabase(address, lock_timeout=lock_timeout)) as database:
        database.migrate()
    database = ServerDatabase(address, lock_timeout=lock_timeout, serving=serving)
    try:
        with database.reading() as connection:
            refuse_newer(current(connection))  # a newer release may have migrated it in between
        database.watch.glance()  # makes its connection: later one would wait behind a migration that waits for this service
    except BaseException:
        database.close()
        raise
    return database


def find_server(address: URL, *, lock_timeout: float) -> ServerDatabase:
    """Open a database on a server to read it as it is. Raises DatabaseTooNew, StorageUnavailable where it has no tables."""
    database = FoundServerDatabase(address, lock_timeout=lock_timeout, writable=False)
    try:
        with database.reading() as connection:
            _refuse_empty(connection, database.name)
            refuse_newer(current(connection))
    except BaseException:
        database.close()
        raise
    return database


def server_has_tables(address: URL, *, lock_timeout: float) -> bool:
    """Whether the database holds this program's tables. Raises StorageUnavailable where there is no such database."""
    database = ServerDatabase(address, lock_timeout=lock_timeout, writable=False)
    try:
        with database.reading() as connection:
            return current(connection) is not None
    finally:
        database.close()


def _refuse_empty(connection: Connection, name: str) -> None:
    if current(connection) is None:
        raise StorageUnavailable(f"{name} is empty: `clutchlife serve` makes its tables")


def _require_utf8(connection: Connection, name: str) -> None:
    encoding = connection.exec_driver_sql("SHOW server_encoding").scalar_one()
    if encoding != "UTF8":
        raise StorageUnavailable(f"{name} is encoded in {encoding}, it must be made with ENCODING 'UTF8'")
