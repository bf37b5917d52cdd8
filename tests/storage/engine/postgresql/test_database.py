"""A database on a server: how it comes to be, who may use it, and what is said where it cannot be used."""

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, closing

import pytest
from sqlalchemy import URL, make_url, text
from sqlalchemy.exc import ProgrammingError

from storage import changes, clutches, raw_columns
from storage.engine.database import Database
from storage.engine.errors import (
    DatabaseBusy,
    DatabaseTooNew,
    DatabaseTooOld,
    ServiceRuns,
    StorageUnavailable,
    UnstorableText,
)
from storage.engine.integrity import other_schema
from storage.engine.opening import database_exists, find_database, open_database
from storage.engine.postgresql import connect as server
from storage.migrations.upgrade import current, head
from tests.storage.engine.postgresql.server import PostgresServer, postgresql_server
from tests.storage.samples import clutch_row, columns, read_from, store_run, take_back, write_to

SECRET = "s3cr3t"  # noqa: S105 - a test's


@pytest.fixture
def database(on_server: Database) -> Database:
    return on_server


@pytest.fixture
def empty(postgresql: PostgresServer) -> Iterator[str]:
    url = postgresql.empty()
    yield url
    postgresql.drop(url)


def set_revision(database: Database, revision: str) -> None:
    with database.writing() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = :revision"), {"revision": revision})


def test_an_empty_database_gets_its_tables_once_whoever_opens_it_first(empty: str) -> None:
    assert not database_exists(empty)
    with pytest.raises(StorageUnavailable, match="is empty"):
        find_database(empty)
    together = threading.Barrier(4)

    def start() -> Database:
        together.wait()
        return open_database(empty)

    with ThreadPoolExecutor(4) as pool, ExitStack() as stack:
        opened = [stack.enter_context(closing(each.result())) for each in [pool.submit(start) for _ in range(4)]]
        assert database_exists(empty)
        with opened[0].reading() as connection:
            assert current(connection) == head()
            assert other_schema(connection) == []
            others = connection.exec_driver_sql(  # text is ordered by its code points
                "SELECT table_name, column_name FROM information_schema.columns WHERE table_schema = current_schema() "
                "AND data_type = 'text' AND collation_name IS DISTINCT FROM 'C' "
                "AND table_name NOT IN ('shared_answer', 'alembic_version')"
            ).fetchall()
            assert others == []
        assert [each.faults(least_free=0) for each in opened] == [{}] * 4


def test_another_schema_is_noticed(database: Database) -> None:
    with database.writing() as connection:
        connection.exec_driver_sql("ALTER TABLE clutch ADD COLUMN forgotten TEXT")
        connection.exec_driver_sql("DROP INDEX run_in_order")
    with database.reading() as connection:
        assert len(other_schema(connection)) == 2
        assert database.damage(connection) == []


def test_a_newer_release_s_database_is_refused(database: Database) -> None:
    set_revision(database, "s9999_later")
    for opening in (open_database, find_database):
        with pytest.raises(DatabaseTooNew, match="s9999_later"):
            opening(database.url)
    assert "s9999_later" in database.faults(least_free=0)["database"]


@pytest.mark.usefixtures("later_step")
def test_a_database_of_an_earlier_revision_is_not_migrated_under_a_service(database: Database) -> None:
    """Services that run hold it up; once they have ended, several that start at once wait for the one that migrates."""
    services = [open_database(database.url, serving=True) for _ in range(2)]
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
        run_key = store_run(connection, 1)
        take_back(connection)
    for service in services:
        with pytest.raises(ServiceRuns, match="a service uses"):
            open_database(database.url, lock_timeout=0.1)
        service.close()
    together = threading.Barrier(3)

    def start() -> Database:
        together.wait()
        return open_database(database.url, serving=True)

    with ThreadPoolExecutor(3) as pool, ExitStack() as stack:
        for each in [pool.submit(start) for _ in range(3)]:
            stack.enter_context(closing(each.result()))
        with database.reading() as connection:
            assert current(connection) == head()
            assert connection.exec_driver_sql("SELECT count(later), count(*) FROM clutch").one() == (0, 1)
            kept = raw_columns.values_of(raw_columns.stored_of_run(connection, run_key))
            assert all(kept[name].tobytes() == column.tobytes() for name, column in columns(1).items())


@pytest.mark.usefixtures("later_step")
def test_a_service_that_comes_late_to_a_migration_starts_beside_the_one_that_made_it(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_to(database, take_back)
    lock = server.migration_lock
    with ExitStack() as serving:

        def lock_late(address: URL, lock_timeout: float) -> AbstractContextManager[None]:
            monkeypatch.setattr(server, "migration_lock", lock)
            serving.enter_context(closing(open_database(database.url, serving=True)))
            return lock(address, lock_timeout)

        monkeypatch.setattr(server, "migration_lock", lock_late)
        with closing(open_database(database.url, lock_timeout=0.1, serving=True)) as late, late.reading() as connection:
            assert current(connection) == head()


def test_what_came_with_a_later_revision_is_not_found(database: Database) -> None:
    with database.writing() as connection:
        connection.exec_driver_sql("DROP TABLE change")
    with closing(find_database(database.url)) as found:
        with pytest.raises(ProgrammingError), found.reading() as connection:
            changes.page(connection, "c1", limit=1)
        set_revision(database, "s0000_earlier")
        with pytest.raises(DatabaseTooOld, match="s0000_earlier"), found.reading() as connection:
            changes.page(connection, "c1", limit=1)
        with pytest.raises(StorageUnavailable, match="read-only"), found.writing() as connection:
            clutches.insert(connection, clutch_row())


def test_writers_of_one_clutch_wait_for_each_other_and_those_of_others_do_not(database: Database) -> None:
    with closing(open_database(database.url, lock_timeout=0.1)) as impatient:
        with database.writing(of="a"):
            with impatient.writing(of="b") as connection:
                clutches.insert(connection, clutch_row("b"))
            for of in ("a", None):
                with pytest.raises(DatabaseBusy), impatient.writing(of=of):
                    pytest.fail("two writers of the same at once")
        with database.writing(), pytest.raises(DatabaseBusy), impatient.writing(of="a"):
            pytest.fail("beside one who writes of all")
        assert read_from(impatient, clutches.all_ids) == ["b"]


def test_who_reads_a_number_of_commits_sees_all_that_was_committed_up_to_it(database: Database) -> None:
    """Four threads commit at once, of a clutch each; after a number was read, so many commits are there or more."""
    names = ("a", "b", "c", "d")
    with database.writing() as connection:
        for name in names:
            clutches.insert(connection, clutch_row(name))
    first = database.watch.snapshot().version
    enough = threading.Event()

    def write(name: str) -> int:
        written = 0
        while not enough.is_set():
            with database.writing(of=name) as connection:
                clutches.bump_revision(connection, name)
            written += 1
        return written

    seen: list[tuple[int, int]] = []
    with ThreadPoolExecutor(4) as pool:
        writing = [pool.submit(write, name) for name in names]
        while len({number for number, _ in seen}) <= 10 and not any(each.done() for each in writing):
            number = database.watch.snapshot().version
            with database.reading() as connection:
                seen.append((number - first, sum(clutches.revision(connection, name) or 0 for name in names)))
        enough.set()
        written = sum(each.result() for each in writing)
    assert all(committed >= number for number, committed in seen)
    assert database.watch.snapshot().version == first + written


def test_a_database_that_is_not_in_utf8_is_refused(postgresql: PostgresServer) -> None:
    postgresql.execute("CREATE DATABASE latin ENCODING 'LATIN1' LOCALE 'C' TEMPLATE template0")
    with pytest.raises(StorageUnavailable, match="LATIN1"):
        open_database(postgresql.url("latin"))


def test_what_is_acknowledged_is_on_the_disk_whatever_the_database_s_default(
    database: Database, postgresql: PostgresServer
) -> None:
    name = make_url(database.url).database
    postgresql.execute(f"ALTER DATABASE {name} SET synchronous_commit = off")
    with closing(open_database(database.url)) as opened, opened.writing() as connection:
        assert connection.exec_driver_sql("SHOW synchronous_commit").scalar_one() == "on"


def test_text_that_postgresql_does_not_have_is_refused(database: Database) -> None:
    with pytest.raises(UnstorableText, match="NUL"), database.writing() as connection:
        clutches.insert(connection, clutch_row("a\0b"))
    assert database.watch.snapshot("a\0b").revision is None


def test_what_was_committed_is_there_after_the_server_was_killed() -> None:
    """Who has the database open says so while the server is away, and goes on when it is back."""
    with postgresql_server() as server:
        url = server.fresh()
        with closing(open_database(url)) as database:
            write_to(database, clutches.insert, clutch_row())
            before = database.watch.snapshot().version
            server.kill()
            for question in (database.watch.snapshot, lambda: open_database(url)):
                with pytest.raises(StorageUnavailable):
                    question()
            with pytest.raises(StorageUnavailable), database.writing():
                pytest.fail("written without a server")
            assert database.faults(least_free=0)["database"].startswith("the database cannot be read")
            server.start()
            assert database.watch.snapshot().version == before
            write_to(database, store_run, 0)
            assert database.watch.snapshot().version == before + 1
            assert database.faults(least_free=0) == {}


def test_a_transaction_that_the_server_did_not_end_is_not_there() -> None:
    with postgresql_server() as server, closing(open_database(server.fresh())) as database:

        def write_and_lose_the_server() -> None:
            with database.writing() as connection:
                clutches.insert(connection, clutch_row())
                server.kill()

        with pytest.raises(StorageUnavailable):
            write_and_lose_the_server()
        server.start()
        assert read_from(database, clutches.all_ids) == []


@pytest.mark.parametrize(
    ("url", "says"),
    [
        (f"postgresql+psycopg://u:{SECRET}@", "needs a name"),
        (f"postgresql+psycopg://u:{SECRET}@h:port/db", "must be given as"),
        (f"postgresql+psycopg://u:1@{SECRET}@host/db", "%40"),
        (f"postgresql://u:{SECRET}@host/db", "'postgresql'"),
    ],
)
def test_wrong_addresses_are_refused_without_their_password(url: str, says: str) -> None:
    with pytest.raises(ValueError, match=says) as refusal:
        open_database(url)
    assert SECRET not in str(refusal.value)


def test_a_server_that_is_not_there_is_named_without_the_password(postgresql: PostgresServer) -> None:
    for url in (
        f"postgresql+psycopg://u:{SECRET}@127.0.0.1:1/db",
        f"postgresql+psycopg://u:{SECRET}@/none?host={postgresql.folder}&sslpassword={SECRET}",
    ):
        with pytest.raises(StorageUnavailable, match="PostgreSQL database") as refusal:
            open_database(url)
        assert SECRET not in str(refusal.value)


def test_a_missing_driver_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "psycopg", None)
    with pytest.raises(StorageUnavailable, match=r"pip install clutchlife\[postgresql\]"):
        open_database("postgresql+psycopg://u@h/db")
