"""Connections to a server: what they share, keep and say."""

import asyncio
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace

import pytest
from sqlalchemy import create_engine, make_url, text

from storage import clutches
from storage.engine.database import Database, Question, SharedAnswer, Snapshot
from storage.engine.errors import ServiceRuns, StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.postgresql.connect import SERVICE_KEY, SingleStatements, migration_lock
from storage.engine.postgresql.database import ServerWatch
from tests.storage.engine.postgresql.server import postgresql_server
from tests.storage.samples import clutch_row, write_to

ANSWER = SharedAnswer(clutch_id="c1", name="degradation", release="1.0", revision=0, body=b"kept")
_HELD = text("""
SELECT count(*) FROM pg_locks JOIN pg_database ON pg_database.oid = pg_locks.database
WHERE datname = current_database() AND locktype = 'advisory' AND mode = 'ShareLock' AND granted
  AND classid = :high AND objid = :low
""").bindparams(high=SERVICE_KEY >> 32, low=SERVICE_KEY & 0xFFFFFFFF)


def test_every_connection_of_a_service_says_that_it_runs(on_server: Database) -> None:
    """Those for single statements too."""
    with closing(open_database(on_server.url, serving=True)) as service, service.reading():
        assert service.shared_answer("c1", "degradation", "1.0") is None
        with on_server.reading() as connection:
            assert connection.execute(_HELD).scalar_one() == 3


def test_a_service_is_asked_on_while_a_migration_waits_for_its_end(on_server: Database) -> None:
    """Its connection for that is made when it starts: a later one would wait behind the migration."""

    def migrate() -> None:
        with migration_lock(make_url(on_server.url), 3):
            pytest.fail("migrated under a service")

    with closing(open_database(on_server.url, lock_timeout=1, serving=True)) as service, ThreadPoolExecutor(9) as pool:
        waiting = pool.submit(migrate)
        while not waits_for_the_lock(on_server):
            assert not waiting.done()
            time.sleep(0.01)
        snapshots = list(pool.map(lambda _: service.watch.snapshot(), range(200)))
        assert not waiting.done()
        assert len(snapshots) == 200
        with pytest.raises(ServiceRuns):
            waiting.result()


def waits_for_the_lock(database: Database) -> bool:
    with database.reading() as connection:
        waiting = text("SELECT EXISTS (SELECT FROM pg_locks WHERE locktype = 'advisory' AND NOT granted)")
        return bool(connection.execute(waiting).scalar_one())


def test_answers_that_cannot_be_read_hold_up_no_request(on_server: Database) -> None:
    """They are kept to save work: the question that every request asks has a connection of its own."""
    with closing(open_database(on_server.url, lock_timeout=20)) as service, ThreadPoolExecutor(8) as pool:
        with on_server.writing() as connection:
            connection.execute(text("LOCK TABLE shared_answer IN ACCESS EXCLUSIVE MODE"))
            reading = [pool.submit(service.shared_answer, "c1", "degradation", "1.0") for _ in range(8)]
            for _ in range(50):
                assert not service.watch.snapshot().keys_are_needed
            assert not any(each.done() for each in reading)
        assert [each.result() for each in reading] == [None] * 8


def test_libpq_is_told_when_a_lost_machine_counts_as_gone_unless_the_address_says_it(on_server: Database) -> None:
    said = f"{on_server.url}&tcp_user_timeout=5000&keepalives_idle=2&keepalives_interval=1"
    for url, told in ((on_server.url, ("60000", "30", "10")), (said, ("5000", "2", "1"))):
        with closing(open_database(url)) as opened, opened.reading() as connection:
            raw = connection.connection.dbapi_connection
            found = raw.info.get_parameters()
            assert tuple(found[f] for f in ("tcp_user_timeout", "keepalives_idle", "keepalives_interval")) == told


def test_a_statement_finds_the_server_that_was_started_again() -> None:
    """Each on a connection of before, which the server has ended."""
    with postgresql_server() as server, closing(open_database(server.fresh())) as database:
        write_to(database, clutches.insert, clutch_row("c1"))
        database.share(ANSWER)

        def snapshot() -> None:
            assert database.watch.snapshot("c1").revision == 0

        def keep_and_read() -> None:
            database.share(ANSWER)
            assert database.shared_answer("c1", "degradation", "1.0") == ANSWER

        for ask in (snapshot, keep_and_read, snapshot, lambda: database.shared_answer("c1", "degradation", "1.0")):
            server.kill()
            server.start()
            ask()


def test_who_asks_a_database_that_was_closed_is_told_so(on_server: Database) -> None:
    opened = open_database(on_server.url)
    opened.close()
    opened.close()
    for ask in (
        opened.watch.snapshot,
        lambda: asyncio.run(opened.watch.look(Question("a"))),
        lambda: opened.shared_answer("a", "degradation", "1.0"),
    ):
        with pytest.raises(StorageUnavailable, match="has been closed"):
            ask()


# --- What every request asks of a server: one statement for all who ask at the same time.


class Slow(ServerWatch):
    """A server that answers when it is let: the number of the statement is the version."""

    def __init__(self) -> None:
        super().__init__(SingleStatements(create_engine("postgresql+psycopg://"), "slow"), "slow", 30.0)
        self.statements: list[list[Question]] = []
        self.may_answer = threading.Semaphore(0)
        self.fails = False

    def snapshots(self, questions: Sequence[Question]) -> list[Snapshot]:
        self.statements.append(list(questions))
        number = len(self.statements)
        assert self.may_answer.acquire(timeout=30)
        if self.fails:
            raise StorageUnavailable("away")
        return [Snapshot(number, False, None, None if each.clutch_id is None else number) for each in questions]


@pytest.fixture
def slow() -> Iterator[Slow]:
    with closing(Slow()) as watch:
        yield watch


async def sent(watch: Slow, statements: int) -> None:
    """Until so many statements are under way or done."""
    async with asyncio.timeout(30):
        while len(watch.statements) < statements:
            await asyncio.sleep(0.001)


def test_who_asks_while_a_statement_is_under_way_shares_the_next(slow: Slow) -> None:
    async def ask() -> list[Snapshot]:
        first = asyncio.create_task(slow.look(Question("c0")))
        await sent(slow, 1)
        later = [asyncio.create_task(slow.look(Question(f"c{number}"))) for number in range(1, 21)]
        gone = asyncio.create_task(slow.look(Question("gone")))
        await asyncio.sleep(0)
        gone.cancel()
        slow.may_answer.release(2)
        return await asyncio.gather(first, *later)

    found = asyncio.run(ask())
    # no answer is of a statement that began before its question
    assert [each.version for each in found] == [1] + [2] * 20
    assert [len(each) for each in slow.statements] == [1, 21]


def test_what_fails_fails_for_those_who_asked_and_not_for_the_next(slow: Slow) -> None:
    async def ask() -> None:
        slow.fails = True
        slow.may_answer.release(1)
        together = await asyncio.gather(slow.look(Question("a")), slow.look(Question("b")), return_exceptions=True)
        assert [type(each) for each in together] == [StorageUnavailable] * 2
        slow.fails = False
        slow.may_answer.release(1)
        assert (await slow.look(Question("a"))).revision == 2

    asyncio.run(ask())


def test_who_waits_when_it_is_closed_is_told_so(slow: Slow) -> None:
    async def ask() -> list[Snapshot | BaseException]:
        first = asyncio.create_task(slow.look(Question("a")))
        await sent(slow, 1)
        second = asyncio.create_task(slow.look(Question("b")))
        await asyncio.sleep(0)
        slow.may_answer.release()
        slow.close()
        return await asyncio.gather(first, second, return_exceptions=True)

    first, second = asyncio.run(ask())
    assert isinstance(first, Snapshot)
    assert isinstance(second, StorageUnavailable)


def test_a_database_answers_each_what_it_asked(database: Database) -> None:
    with database.writing() as connection:
        for name in ("a", "b"):
            clutches.insert(connection, clutch_row(name))
        clutches.bump_revision(connection, "b")

    async def ask() -> list[Snapshot]:
        names = ("b", "a", "b", None, "unknown", "a\0b")
        return await asyncio.gather(*(database.watch.look(Question(name)) for name in names))

    found = asyncio.run(ask())
    assert [each.revision for each in found] == [1, 0, 1, None, None, None]
    assert len({each.version for each in found}) == 1
    assert not any(each.keys_are_needed for each in found)


# --- The last computed answers, which the services on a server share.

FIRST = replace(ANSWER, revision=3, body=b"\x00first")


def test_the_last_of_each_clutch_and_name_is_kept(on_server: Database) -> None:
    assert on_server.shared_answer("c1", "degradation", "1.0") is None
    for kept in (FIRST, replace(FIRST, clutch_id="c2"), replace(FIRST, name="surface", body=b"other")):
        on_server.share(kept)
        assert on_server.shared_answer(kept.clutch_id, kept.name, "1.0") == kept
    later = replace(FIRST, revision=4, body=b"later")
    on_server.share(later)
    on_server.share(FIRST)  # of one that was slower
    assert on_server.shared_answer("c1", "degradation", "1.0") == later
    # another release computes its own and replaces it
    assert on_server.shared_answer("c1", "degradation", "2.0") is None
    on_server.share(replace(FIRST, release="2.0", revision=2))
    assert on_server.shared_answer("c1", "degradation", "1.0") is None
    assert on_server.shared_answer("c1", "degradation", "2.0") == replace(FIRST, release="2.0", revision=2)


def test_a_database_of_before_gets_the_table_and_counts_its_commits_on(on_server: Database) -> None:
    write_to(on_server, clutches.insert, clutch_row("c1"))
    with on_server.writing() as connection:
        connection.execute(text("DROP TABLE shared_answer"))
    counted = on_server.watch.snapshot().version
    with closing(open_database(on_server.url)) as opened:
        opened.share(FIRST)
        assert opened.watch.snapshot().version == counted + 1  # of the commit that made the table
