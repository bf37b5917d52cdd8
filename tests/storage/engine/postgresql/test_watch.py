"""What every request asks of a server: one statement for all who ask at the same time."""

import asyncio
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing

import pytest
from sqlalchemy import create_engine

from storage import clutches
from storage.engine.database import Database, Question, Snapshot
from storage.engine.errors import StorageUnavailable
from storage.engine.postgresql.connect import SingleStatements
from storage.engine.postgresql.database import ServerWatch
from tests.storage.samples import clutch_row


class Slow(ServerWatch):
    """A server that answers when it is let: the number of the statement is the version."""

    def __init__(self) -> None:
        super().__init__(SingleStatements(create_engine("postgresql+psycopg://"), "slow"))
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
