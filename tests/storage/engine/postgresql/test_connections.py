"""The connections of a service to a server: what they say of it, and what becomes of them when the server comes back."""

import asyncio
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from sqlalchemy import make_url, text

from storage import clutches
from storage.engine.database import Database, Question, SharedAnswer
from storage.engine.errors import ServiceRuns, StorageUnavailable
from storage.engine.opening import open_database
from storage.engine.postgresql.connect import SERVICE_KEY, migration_lock
from tests.storage.engine.postgresql.server import postgresql_server
from tests.storage.samples import clutch_row

ANSWER = SharedAnswer(clutch_id="c1", name="degradation", release="1.0", revision=0, body=b"kept")
_HELD = text("""
SELECT count(*) FROM pg_locks JOIN pg_database ON pg_database.oid = pg_locks.database
WHERE datname = current_database() AND locktype = 'advisory' AND mode = 'ShareLock' AND granted
  AND classid = :high AND objid = :low
""").bindparams(high=SERVICE_KEY >> 32, low=SERVICE_KEY & 0xFFFFFFFF)


def test_every_connection_of_a_service_says_that_it_runs(on_server: Database) -> None:
    """Those for single statements too."""
    with closing(open_database(on_server.url, serving=True)) as service, service.reading():
        assert service.answers is not None
        assert service.answers.newest("c1", "degradation", "1.0") is None
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
        answers = service.answers
        assert answers is not None
        with on_server.writing() as connection:
            connection.execute(text("LOCK TABLE shared_answer IN ACCESS EXCLUSIVE MODE"))
            reading = [pool.submit(answers.newest, "c1", "degradation", "1.0") for _ in range(8)]
            for _ in range(50):
                assert not service.watch.snapshot().keys_are_needed
            assert not any(each.done() for each in reading)
        assert [each.result() for each in reading] == [None] * 8


def test_libpq_is_told_when_a_lost_machine_counts_as_gone_unless_the_address_says_it(on_server: Database) -> None:
    said = f"{on_server.url}&tcp_user_timeout=5000&keepalives_idle=2&keepalives_interval=1"
    for url, told in ((on_server.url, ("60000", "30", "10")), (said, ("5000", "2", "1"))):
        with closing(open_database(url)) as opened, opened.reading() as connection:
            raw = connection.connection.dbapi_connection
            assert raw is not None
            found = raw.info.get_parameters()
            assert tuple(found[f] for f in ("tcp_user_timeout", "keepalives_idle", "keepalives_interval")) == told


def test_a_statement_finds_the_server_that_was_started_again() -> None:
    """Each on a connection of before, which the server has ended."""
    with postgresql_server() as server, closing(open_database(server.fresh())) as database:
        answers = database.answers
        assert answers is not None
        with database.writing() as connection:
            clutches.insert(connection, clutch_row("c1"))
        answers.keep(ANSWER)

        def snapshot() -> None:
            assert database.watch.snapshot("c1").revision == 0

        def keep_and_read() -> None:
            answers.keep(ANSWER)
            assert answers.newest("c1", "degradation", "1.0") == ANSWER

        for ask in (snapshot, keep_and_read, snapshot, lambda: answers.newest("c1", "degradation", "1.0")):
            server.kill()
            server.start()
            ask()


def test_who_asks_a_database_that_was_closed_is_told_so(on_server: Database) -> None:
    opened = open_database(on_server.url)
    answers = opened.answers
    assert answers is not None
    opened.close()
    opened.close()
    for ask in (
        opened.watch.snapshot,
        lambda: asyncio.run(opened.watch.look(Question("a"))),
        lambda: answers.newest("a", "degradation", "1.0"),
    ):
        with pytest.raises(StorageUnavailable, match="has been closed"):
            ask()
