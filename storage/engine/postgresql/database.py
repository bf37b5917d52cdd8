"""A database on a server: its transactions, how its tables come to be, what requests ask of it, and shared answers.

Writers of one clutch queue for a lock of that clutch, so that its rows are committed in the order of the numbers that they
get (revisions, keys); those of different clutches write at once. Who writes of all clutches together waits for all of them.
`commits`, the number of all, is given last: from then until it is committed a transaction holds that row.

Computed answers are in a table that is not logged: a server that crashes empties it, and they are computed again.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from typing import Literal

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert
from sqlalchemy.exc import SQLAlchemyError

from storage.engine.database import LOCK_TIMEOUT, Database, Question, SharedAnswer, Snapshot, Watch, granted, tracer
from storage.engine.errors import ServiceRuns, StorageError, StorageUnavailable
from storage.engine.integrity import refuse_newer
from storage.engine.postgresql import connect
from storage.migrations.upgrade import current, head, upgrade

shared_answer = sa.Table(
    "shared_answer",
    connect.server_tables,
    sa.Column("clutch_id", sa.Text, primary_key=True),
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("release", sa.Text, nullable=False),
    sa.Column("revision", sa.BigInteger, nullable=False),
    sa.Column("body", sa.LargeBinary, nullable=False),
    prefixes=["UNLOGGED"],
)

_newest = sa.select(shared_answer).where(
    shared_answer.c.clutch_id == sa.bindparam("clutch"),
    shared_answer.c.name == sa.bindparam("asked"),
    shared_answer.c.release == sa.bindparam("by"),
)
_new = insert(shared_answer)
#: Another build's answer is replaced, whatever its revision: a clutch has one row of a name.
_keep = _new.on_conflict_do_update(
    index_elements=["clutch_id", "name"],
    set_={name: _new.excluded[name] for name in ("release", "revision", "body")},
    where=sa.or_(
        shared_answer.c.release != _new.excluded["release"], shared_answer.c.revision <= _new.excluded["revision"]
    ),
)


_SNAPSHOT = sa.text("""
SELECT (SELECT number FROM commits) AS version,
       EXISTS (SELECT 1 FROM access_key) AS keys_are_needed,
       (SELECT json_object_agg(clutch_id, revision) FROM clutch WHERE clutch_id = ANY(:clutches)) AS revisions,
       (SELECT json_object_agg(secret_sha256, json_build_array(key_id, scope, note, clutches, expires_at))
          FROM access_key WHERE secret_sha256 = ANY(:secrets) AND revoked_at IS NULL) AS keys
""")


class ServerWatch(Watch):
    """The watch of a database on a server: one statement answers all waiting callers."""

    def __init__(self, statements: connect.SingleStatements, name: str, patience: float) -> None:
        super().__init__(name, patience)
        self._statements = statements

    def snapshots(self, questions: Sequence[Question]) -> list[Snapshot]:
        # no clutch is named by what the server cannot store
        clutches = sorted(
            {
                question.clutch_id
                for question in questions
                if question.clutch_id is not None and "\0" not in question.clutch_id
            }
        )
        secrets = sorted({question.secret_sha256 for question in questions if question.secret_sha256 is not None})
        [row] = self._statements.rows(_SNAPSHOT, {"clutches": clutches, "secrets": secrets})
        revisions, keys = row["revisions"] or {}, row["keys"] or {}
        return [
            Snapshot(
                version=row["version"] or 0,
                keys_are_needed=row["keys_are_needed"],
                key=granted(tuple(keys[question.secret_sha256])) if question.secret_sha256 in keys else None,
                revision=revisions.get(question.clutch_id),
            )
            for question in questions
        ]


#: A transaction that changed nothing has no number and is not counted.
_COUNT = connect.count_commit.where(sa.text("pg_current_xact_id_if_assigned() IS NOT NULL"))


class ServerDatabase(Database):
    """An open database on a server. Made by `open_server`."""

    path = None
    journal_mode = None

    def __init__(self, address: sa.URL, *, lock_timeout: float, found: bool = False, serving: bool = False) -> None:
        super().__init__(connect.shown(address), found=found)
        self.url = address.render_as_string(hide_password=False)
        self._address = address
        self._lock_timeout = lock_timeout
        self._engine = connect.make_engine(address, lock_timeout)
        self._readers = self._engine.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)
        # a statement of a writer sees what was committed before the lock was free
        self._writers = self._engine.execution_options(isolation_level="READ COMMITTED", postgresql_readonly=found)
        # what every request asks does not wait for connections by which answers are read and written
        watching = connect.make_autocommit_engine(address, lock_timeout, connections=1)
        sharing = connect.make_autocommit_engine(address, lock_timeout, connections=2)
        if serving:
            for engine in (self._engine, watching, sharing):
                connect.hold_service_lock(engine, self.name)
        self._watching, self._sharing = (
            connect.SingleStatements(watching, self.name),
            connect.SingleStatements(sharing, self.name),
        )
        self.watch = ServerWatch(self._watching, self.name, lock_timeout)

    @contextmanager
    def _read(self) -> Iterator[sa.Connection]:
        with connect.translated(self.name), self._readers.begin() as connection:
            yield connection

    @contextmanager
    def writing(self, *, of: str | None = None) -> Iterator[sa.Connection]:
        self._refuse_closed()
        with tracer.start_as_current_span("store"), connect.translated(self.name), self._writers.begin() as connection:
            connect.write_lock(connection, of)
            yield connection
            connection.execute(_COUNT)

    def shared_answer(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:
        rows = self._sharing.rows(_newest, {"clutch": clutch_id, "asked": name, "by": release})
        return SharedAnswer(**rows[0]) if rows else None

    def share(self, answer: SharedAnswer) -> None:
        self._sharing.rows(_keep, {column.name: getattr(answer, column.name) for column in shared_answer.columns})

    def faults(self, *, least_free: int) -> dict[str, str]:  # noqa: ARG002  (the server's disk is its operator's)
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
        return {"database": "the server is a standby and read-only: connect to the primary server"} if standby else {}

    def damage(self, connection: sa.Connection) -> list[str]:  # noqa: ARG002  (pages are the server's: pg_amcheck)
        """Always empty: the server refuses rows that refer to missing ones, and checks its pages itself."""
        return []

    def close(self) -> None:
        self._closed = True
        self._engine.dispose()
        self.watch.close()
        self._watching.close()
        self._sharing.close()

    def migrate(self) -> None:
        """Create the tables of an empty database, or run the missing migrations, but never under a running service."""
        to_migrate = self._to_migrate()
        if to_migrate is None:
            return
        try:
            with (
                connect.migration_lock(self._address, self._lock_timeout) if to_migrate == "older" else nullcontext(),
                self.writing() as connection,
            ):
                revision = current(connection)  # another process may have been before
                if revision != head():
                    refuse_newer(revision)
                    upgrade(connection)
                connect.server_tables.create_all(connection)
                if revision is None:
                    connection.execute(connect.commits.insert().values(number=0))
        except ServiceRuns:
            # the service that runs may be the one that was before, and has nothing left to do
            if self._to_migrate() is not None:
                raise

    def _to_migrate(self) -> Literal["empty", "older"] | None:
        """Whether a migration is needed: "empty", "older" (a service may be using it now), or None. Raises
        StorageUnavailable if the database's text is not UTF-8."""
        with self.reading() as connection:
            _require_utf8(connection, self.name)
            revision = current(connection)
            has_server_tables = set(sa.inspect(connection).get_table_names()) >= set(connect.server_tables.tables)
        if revision == head() and has_server_tables:
            return None
        return "empty" if revision is None else "older"


def open_server(address: sa.URL, *, lock_timeout: float, serving: bool = False) -> ServerDatabase:
    """Open a database on a server, make the tables of an empty one and run the migrations that it lacks.

    Raises DatabaseTooNew on that of a newer release, StorageUnavailable where it cannot be used or is not in UTF-8,
    DatabaseBusy where another writes for `lock_timeout` [s], ServiceRuns where it is to be migrated under a service.

    `serving`: it is a service that opens it; from then on until it is closed nobody migrates the database.
    """
    with closing(ServerDatabase(address, lock_timeout=lock_timeout)) as database:
        database.migrate()
    database = ServerDatabase(address, lock_timeout=lock_timeout, serving=serving)

    def check(connection: sa.Connection) -> None:
        refuse_newer(current(connection))  # a newer release may have migrated it in between
        database.watch.snapshot()  # makes its connection: a later one waits behind a migration that waits for this service

    return database.where(check)


def find_server(address: sa.URL) -> ServerDatabase:
    """Open a database on a server for reading, at its present revision. Raises DatabaseTooNew, StorageUnavailable if it
    has no tables."""
    database = ServerDatabase(address, lock_timeout=LOCK_TIMEOUT, found=True)

    def check(connection: sa.Connection) -> None:
        revision = current(connection)
        if revision is None:
            raise StorageUnavailable(f"{database.name} is empty: `clutchlife serve` makes its tables")
        refuse_newer(revision)

    return database.where(check)


def server_has_tables(address: sa.URL) -> bool:
    """Whether the database has this program's tables. Raises StorageUnavailable if there is no such database."""
    with (
        closing(ServerDatabase(address, lock_timeout=LOCK_TIMEOUT, found=True)) as database,
        database.reading() as connection,
    ):
        return current(connection) is not None


def _require_utf8(connection: sa.Connection, name: str) -> None:
    encoding = connection.exec_driver_sql("SHOW server_encoding").scalar_one()
    if encoding != "UTF8":
        raise StorageUnavailable(f"{name} is encoded in {encoding}, it must be made with ENCODING 'UTF8'")
