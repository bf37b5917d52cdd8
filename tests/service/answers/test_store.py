"""The cache of computed answers: bounded by bytes, least lately asked for first, each answer made once."""

import asyncio
import threading
from collections.abc import Awaitable, Callable, Coroutine
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from service.answers import store as caches
from service.answers.store import (
    AnswerStore,
    CachedAnswer,
    Made,
    build_of,
    revision_and_json,
    shared_answer,
    to_json,
)
from service.api.base import Answer, Real
from service.settings import CODE_VERSION
from service.web.limits import MAX_CACHED_BYTES
from storage import clutches
from storage.engine.database import Database
from storage.engine.errors import StorageUnavailable
from storage.engine.opening import open_database
from tests.storage.samples import clutch_row, write_to


@pytest.fixture(autouse=True)
def bodies_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Count bodies of a few bytes as what they are."""
    monkeypatch.setattr(caches, "KEPT_BESIDE_BYTES", 0)


def made(cache: AnswerStore, name: str, body: bytes) -> bool:
    """Whether the answer had to be made."""
    calls = []

    def make() -> bytes:
        calls.append(name)
        return body

    assert cache.answer(name, 1, make).body == body
    return bool(calls)


class Named(Answer):
    name: str
    value: Real = 0.0


def test_the_least_lately_asked_for_goes_first_and_no_more_than_must() -> None:
    assert MAX_CACHED_BYTES < 2**27
    cache = AnswerStore(10)
    assert [made(cache, name, name.encode() * size) for name, size in (("a", 4), ("b", 4), ("c", 2))] == [True] * 3
    assert not made(cache, "a", b"aaaa")  # b is now the one not asked for longest
    assert made(cache, "d", b"ddd")
    assert [made(cache, "a", b"aaaa"), made(cache, "c", b"cc"), made(cache, "d", b"ddd")] == [False] * 3
    assert made(cache, "b", b"bbbb")
    cache = AnswerStore(8)
    assert [made(cache, name, b"four") for name in ("a", "b")] == [True] * 2
    assert cache.held("a", 1) is not None  # a poll counts as asking, too
    assert made(cache, "c", b"four")
    assert [cache.held(name, 1) is not None for name in ("a", "b", "c")] == [True, False, True]


def test_an_answer_larger_than_all_may_be_together_is_given_and_not_kept() -> None:
    cache = AnswerStore(10)
    assert made(cache, "small", b"s")
    assert [made(cache, "large", b"l" * 11) for _ in range(2)] == [True, True]
    assert not made(cache, "small", b"s")


def test_answers_without_a_body_take_room_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caches, "KEPT_BESIDE_BYTES", 10)
    cache = AnswerStore(100)
    for number in range(50):
        made(cache, str(number), b"")
    assert sum(cache.held(str(number), 1) is not None for number in range(50)) == 10


class Slow:
    """An answer that is made only when it is let go."""

    def __init__(self) -> None:
        self.calls, self.started, self.release = 0, threading.Event(), threading.Event()

    def __call__(self) -> bytes:
        self.calls += 1
        self.started.set()
        assert self.release.wait(30)
        return b"slow"


def test_of_several_that_ask_at_once_one_computes() -> None:
    cache, slow = AnswerStore(100), Slow()
    with ThreadPoolExecutor(4) as pool:
        first = pool.submit(cache.answer, "a", 1, slow)
        assert slow.started.wait(30)
        others = [pool.submit(cache.answer, "a", 1, slow) for _ in range(3)]
        assert cache.answer("b", 1, lambda: b"not held up").body == b"not held up"
        slow.release.set()
        assert {answer.result(30).body for answer in (first, *others)} == {b"slow"}
    assert slow.calls == 1


def test_of_a_key_one_version_is_held_and_counted() -> None:
    cache = AnswerStore(10)
    for version in range(20):
        assert cache.held("a", version) is None
        assert cache.answer("a", version, lambda: b"aaaa").body == b"aaaa"
        assert cache.held("a", version) is not None
        assert cache.held("a", version - 1) is None
    assert made(cache, "b", b"bbbb")
    assert cache.held("a", 19) is not None  # one answer's bytes are counted, not those of twenty


def test_a_slow_old_version_does_not_replace_a_newer_one() -> None:
    cache, old = AnswerStore(100), Slow()
    with ThreadPoolExecutor(1) as pool:
        slow = pool.submit(cache.answer, "a", 1, old)
        assert old.started.wait(30)
        new = cache.answer("a", 2, lambda: b"new")
        old.release.set()
        assert slow.result(30).body == b"slow"
    assert cache.held("a", 2) == new
    assert cache.answer("a", 3, lambda: b"newer") == cache.held("a", 3)


def test_what_fails_fails_for_all_and_is_tried_again() -> None:
    cache = AnswerStore(100)

    def failing() -> bytes:
        raise LookupError("not there")

    for _ in range(2):
        with pytest.raises(LookupError, match="not there"):
            cache.answer("a", 1, failing)
    assert cache.answer("a", 1, lambda: b"there").body == b"there"


def test_no_number_leaves_that_json_cannot_carry() -> None:
    assert to_json(Named(name="µ", value=0.1)) == '{"name":"µ","value":0.1}'.encode()
    assert to_json(Named(name="µ", value=1)) == '{"name":"µ","value":1}'.encode()
    assert to_json(Named(name="µ")) == '{"name":"µ"}'.encode()
    with pytest.raises(ValueError, match="JSON"):
        to_json(Named(name="", value=float("nan")))


def test_of_several_services_on_a_server_one_computes(on_server: Database) -> None:
    computed: list[str] = []

    def count(_: Database, clutch_id: str, *arguments: str) -> Named:
        computed.append(clutch_id)
        return Named(name=f"{len(arguments)} arguments", value=len(computed))

    write_to(on_server, clutches.insert, clutch_row("c1"))
    with closing(open_database(on_server.url)) as other:
        assert shared_answer(other, count, "c1") is None
        first = revision_and_json(on_server, count, "c1", ())
        assert first == (0, b'{"name":"0 arguments","value":1}')
        assert revision_and_json(other, count, "c1", ()) == first
        assert shared_answer(other, count, "c1") == first
        with on_server.writing(of="c1") as connection:
            clutches.bump_revision(connection, "c1")
        assert shared_answer(other, count, "c1") == first
        assert revision_and_json(other, count, "c1", ()) == (1, b'{"name":"0 arguments","value":2}')
        # with arguments, of which there are any number, nothing is kept
        assert revision_and_json(on_server, count, "c1", ("ukf",)) == (1, b'{"name":"1 arguments","value":3}')
        assert revision_and_json(other, count, "c1", ("ukf",)) == (1, b'{"name":"1 arguments","value":4}')
    assert len(computed) == 4


def test_another_build_of_the_release_computes_for_itself(on_server: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    def query(_: Database, clutch_id: str) -> Named:
        return Named(name=f"{clutch_id} by {caches.BUILD}")

    write_to(on_server, clutches.insert, clutch_row("c1"))
    _, first = revision_and_json(on_server, query, "c1", ())
    monkeypatch.setattr(caches, "BUILD", f"{CODE_VERSION}+other")
    assert shared_answer(on_server, query, "c1") is None
    _, other = revision_and_json(on_server, query, "c1", ())
    assert other != first
    assert shared_answer(on_server, query, "c1") == (0, other)


def test_a_build_is_told_by_its_code_and_by_the_names_of_its_files(tmp_path: Path) -> None:
    code = tmp_path / "law.py"
    builds = []
    for text in ("EXPONENT = 1.3", "EXPONENT = 1.4", "EXPONENT = 1.3"):
        code.write_text(text)
        builds.append(build_of([tmp_path]))
    code.rename(tmp_path / "laws.py")
    builds.append(build_of([tmp_path]))
    assert builds[0] == builds[2]
    assert len(set(builds)) == 3
    assert all(each.startswith(f"{CODE_VERSION}+") for each in builds)


def test_an_answer_that_cannot_be_shared_is_an_answer_all_the_same(
    in_file: Database, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def query(database: Database, clutch_id: str) -> Named:  # noqa: ARG001
        return Named(name=clutch_id)

    def gone(*_: object) -> None:
        raise StorageUnavailable("the connection is gone")

    # as of a server that has just been restarted
    monkeypatch.setattr(in_file, "shared_answer", gone)
    monkeypatch.setattr(in_file, "share", gone)
    assert shared_answer(in_file, query, "c1") is None
    assert revision_and_json(in_file, query, "c1", ()) == (0, b'{"name":"c1"}')
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 3


# --- Slow answers: waited for where there is none, given as they were while a newer one is made, made once.

Asked = tuple[int, CachedAnswer]


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


def scenario(test: Callable[[AnswerStore, Worker], Awaitable[None]]) -> Callable[[], None]:
    """A test in a loop of its own, with room for two answers of 4 bytes."""

    def run() -> None:
        async def whole() -> None:
            await asyncio.wait_for(test(AnswerStore(8), Worker()), 30)

        asyncio.run(whole())

    return run


@scenario
async def test_the_first_answer_is_waited_for_and_made_once(kept: AnswerStore, worker: Worker) -> None:
    waiting = [asyncio.create_task(kept.renewed("a", 1, worker.compute, wait=0)) for _ in range(3)]
    await _settled()
    assert not any(task.done() for task in waiting)
    await worker.gives(1, b"one")
    assert {task.result() for task in waiting} == {(1, CachedAnswer.of(b"one"))}
    assert await kept.renewed("a", 1, worker.compute, wait=0) == (1, CachedAnswer.of(b"one"))
    assert len(worker.asked) == 1
    assert kept.held("a", 1) == CachedAnswer.of(b"one")
    assert kept.held("a", 2) is None


async def _held_at_one(kept: AnswerStore, worker: Worker) -> None:
    """An answer of revision 1 is there."""
    first = await _asking(kept.renewed("a", 1, worker.compute, wait=0))
    await worker.gives(1, b"one")
    assert (await first)[0] == 1


async def _asking(asked: Coroutine[Any, Any, Asked]) -> "asyncio.Task[Asked]":
    """Somebody who asks, and is as far as may be without the worker."""
    task = asyncio.create_task(asked)
    await _settled()
    return task


@scenario
async def test_who_does_not_wait_gets_the_last_one_while_the_next_is_made(kept: AnswerStore, worker: Worker) -> None:
    await _held_at_one(kept, worker)
    for revision in (2, 3):
        assert await kept.renewed("a", revision, worker.compute, wait=0) == (1, CachedAnswer.of(b"one"))
    assert worker.waited_for == [True, False]  # one renewal for both
    await worker.gives(2, b"two")
    assert await kept.renewed("a", 2, worker.compute, wait=0) == (2, CachedAnswer.of(b"two"))


@scenario
async def test_who_waits_does_not_wait_for_a_renewal_that_yields_to_all_others(
    kept: AnswerStore, worker: Worker
) -> None:
    await _held_at_one(kept, worker)
    assert await kept.renewed("a", 2, worker.compute, wait=0) == (1, CachedAnswer.of(b"one"))
    renewal = worker.asked[-1]
    assert await kept.renewed("a", 3, worker.compute, wait=0.01) == (1, CachedAnswer.of(b"one"))
    patient = [asyncio.create_task(kept.renewed("a", 3, worker.compute, wait=20)) for _ in range(3)]
    await _settled()
    assert worker.waited_for == [True, False, True]  # one for all who wait
    await worker.gives(2, b"two")
    assert not any(task.done() for task in patient)  # a revision came while it was made
    assert worker.waited_for == [True, False, True, True]
    await worker.gives(3, b"3rd")
    assert {await task for task in patient} == {(3, CachedAnswer.of(b"3rd"))}
    renewal.set_result((2, b"old"))
    await _settled()
    assert kept.held("a", 3) == CachedAnswer.of(b"3rd")  # the slower and older one replaces nothing


@scenario
async def test_who_waits_takes_a_quicker_renewal_and_does_not_hear_of_its_failure(
    kept: AnswerStore, worker: Worker
) -> None:
    await _held_at_one(kept, worker)
    for revision, error in ((2, None), (3, LookupError("not there"))):
        await kept.renewed("a", revision, worker.compute, wait=0)
        renewal = worker.asked[-1]
        patient = await _asking(kept.renewed("a", revision, worker.compute, wait=20))
        if error is None:
            renewal.set_result((revision, b"idle"))
            assert await patient == (revision, CachedAnswer.of(b"idle"))
        else:
            renewal.set_exception(error)
            await _settled()
            assert not patient.done()
        await worker.gives(revision, b"busy")
        assert (await patient)[0] == revision


@scenario
async def test_what_fails_is_told_to_those_who_wait_and_tried_again(kept: AnswerStore, worker: Worker) -> None:
    first = await _asking(kept.renewed("a", 1, worker.compute, wait=0))
    worker.asked[-1].set_exception(LookupError("not there"))
    with pytest.raises(LookupError, match="not there"):
        await first
    await _held_at_one(kept, worker)
    waiting = await _asking(kept.renewed("a", 2, worker.compute, wait=20))
    worker.asked[-1].set_exception(LookupError("not now"))
    with pytest.raises(LookupError, match="not now"):
        await waiting
    assert await kept.renewed("a", 2, worker.compute, wait=0) == (1, CachedAnswer.of(b"one"))


@scenario
async def test_what_is_being_made_is_not_made_twice_to_make_room(kept: AnswerStore, worker: Worker) -> None:
    kept.begin("renewed", 1, b"four")
    assert await kept.renewed("renewed", 2, worker.compute, wait=0) == (1, CachedAnswer.of(b"four"))
    first = await _asking(kept.renewed("made", 1, worker.compute, wait=0))
    for name in ("a", "b", "c"):
        kept.begin(name, 1, b"four")
    second = asyncio.create_task(kept.renewed("made", 1, worker.compute, wait=0))
    assert await kept.renewed("renewed", 2, worker.compute, wait=0) == (1, CachedAnswer.of(b"four"))
    await _settled()
    assert [name for name in ("renewed", "made", "a", "b", "c") if kept.knows(name)] == ["renewed", "made", "c"]
    await worker.gives(1, b"one")
    assert await first == await second == (1, CachedAnswer.of(b"one"))
    assert len(worker.asked) == 2
