"""Slow answers: waited for where there is none, given as they were while a newer one is made, made once."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from concurrent.futures import Future
from typing import Any

import pytest

from service.queries import cache
from service.queries.cache import Answer, AnswerCache, Made, Revalidation

Asked = tuple[int, Answer]


@pytest.fixture(autouse=True)
def bodies_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Count bodies of a few bytes as what they are."""
    monkeypatch.setattr(cache, "KEPT_BESIDE_BYTES", 0)


class Worker:
    """Makes what it is asked for when the test says so."""

    def __init__(self) -> None:
        self.asked: list[Future[Made]] = []
        self.waited_for: list[bool] = []

    def compute(self, waited_for: bool) -> "Future[Made]":
        self.waited_for.append(waited_for)
        self.asked.append(Future())
        return self.asked[-1]

    async def gives(self, revision: int, body: bytes) -> None:
        """Answer the call that waits."""
        self.asked[-1].set_result((revision, body))
        await _settled()


async def _settled() -> None:
    for _ in range(10):
        await asyncio.sleep(0)


def scenario(test: Callable[[Revalidation, Worker], Awaitable[None]]) -> Callable[[], None]:
    """A test in a loop of its own, with room for two answers of 4 bytes."""

    def run() -> None:
        async def whole() -> None:
            await asyncio.wait_for(test(Revalidation(AnswerCache(8)), Worker()), 30)

        asyncio.run(whole())

    return run


@scenario
async def test_the_first_answer_is_waited_for_and_made_once(kept: Revalidation, worker: Worker) -> None:
    waiting = [asyncio.create_task(kept.answer("a", 1, worker.compute, wait=0)) for _ in range(3)]
    await _settled()
    assert not any(task.done() for task in waiting)
    await worker.gives(1, b"one")
    assert {task.result() for task in waiting} == {(1, Answer.of(b"one"))}
    assert await kept.answer("a", 1, worker.compute, wait=0) == (1, Answer.of(b"one"))
    assert len(worker.asked) == 1
    assert kept._cache.held("a", 1) == Answer.of(b"one")
    assert kept._cache.held("a", 2) is None


async def _held_at_one(kept: Revalidation, worker: Worker) -> None:
    """An answer of revision 1 is there."""
    first = await _asking(kept.answer("a", 1, worker.compute, wait=0))
    await worker.gives(1, b"one")
    assert (await first)[0] == 1


async def _asking(asked: Coroutine[Any, Any, Asked]) -> "asyncio.Task[Asked]":
    """Somebody who asks, and is as far as may be without the worker."""
    task = asyncio.create_task(asked)
    await _settled()
    return task


@scenario
async def test_who_does_not_wait_gets_the_last_one_while_the_next_is_made(kept: Revalidation, worker: Worker) -> None:
    await _held_at_one(kept, worker)
    for revision in (2, 3):
        assert await kept.answer("a", revision, worker.compute, wait=0) == (1, Answer.of(b"one"))
    assert worker.waited_for == [True, False]  # one renewal for both
    await worker.gives(2, b"two")
    assert await kept.answer("a", 2, worker.compute, wait=0) == (2, Answer.of(b"two"))


@scenario
async def test_who_waits_does_not_wait_for_a_renewal_that_yields_to_all_others(
    kept: Revalidation, worker: Worker
) -> None:
    await _held_at_one(kept, worker)
    assert await kept.answer("a", 2, worker.compute, wait=0) == (1, Answer.of(b"one"))
    renewal = worker.asked[-1]
    assert await kept.answer("a", 3, worker.compute, wait=0.01) == (1, Answer.of(b"one"))
    patient = [asyncio.create_task(kept.answer("a", 3, worker.compute, wait=20)) for _ in range(3)]
    await _settled()
    assert worker.waited_for == [True, False, True]  # one for all who wait
    await worker.gives(2, b"two")
    assert not any(task.done() for task in patient)  # a revision came while it was made
    assert worker.waited_for == [True, False, True, True]
    await worker.gives(3, b"3rd")
    assert {await task for task in patient} == {(3, Answer.of(b"3rd"))}
    renewal.set_result((2, b"old"))
    await _settled()
    assert kept._cache.held("a", 3) == Answer.of(b"3rd")  # the slower and older one replaces nothing


@scenario
async def test_who_waits_takes_a_quicker_renewal_and_does_not_hear_of_its_failure(
    kept: Revalidation, worker: Worker
) -> None:
    await _held_at_one(kept, worker)
    for revision, error in ((2, None), (3, LookupError("not there"))):
        await kept.answer("a", revision, worker.compute, wait=0)
        renewal = worker.asked[-1]
        patient = await _asking(kept.answer("a", revision, worker.compute, wait=20))
        if error is None:
            renewal.set_result((revision, b"idle"))
            assert await patient == (revision, Answer.of(b"idle"))
        else:
            renewal.set_exception(error)
            await _settled()
            assert not patient.done()
        await worker.gives(revision, b"busy")
        assert (await patient)[0] == revision


@scenario
async def test_what_fails_is_told_to_those_who_wait_and_tried_again(kept: Revalidation, worker: Worker) -> None:
    first = await _asking(kept.answer("a", 1, worker.compute, wait=0))
    worker.asked[-1].set_exception(LookupError("not there"))
    with pytest.raises(LookupError, match="not there"):
        await first
    await _held_at_one(kept, worker)
    waiting = await _asking(kept.answer("a", 2, worker.compute, wait=20))
    worker.asked[-1].set_exception(LookupError("not now"))
    with pytest.raises(LookupError, match="not now"):
        await waiting
    assert await kept.answer("a", 2, worker.compute, wait=0) == (1, Answer.of(b"one"))


@scenario
async def test_what_is_being_made_is_not_made_twice_to_make_room(kept: Revalidation, worker: Worker) -> None:
    kept.begin("renewed", 1, b"four")
    assert await kept.answer("renewed", 2, worker.compute, wait=0) == (1, Answer.of(b"four"))
    first = await _asking(kept.answer("made", 1, worker.compute, wait=0))
    for name in ("a", "b", "c"):
        kept.begin(name, 1, b"four")
    second = asyncio.create_task(kept.answer("made", 1, worker.compute, wait=0))
    assert await kept.answer("renewed", 2, worker.compute, wait=0) == (1, Answer.of(b"four"))
    await _settled()
    assert [name for name in ("renewed", "made", "a", "b", "c") if kept.knows(name)] == ["renewed", "made", "c"]
    await worker.gives(1, b"one")
    assert await first == await second == (1, Answer.of(b"one"))
    assert len(worker.asked) == 2
