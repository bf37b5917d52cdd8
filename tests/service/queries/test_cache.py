"""The cache of computed answers: bounded by bytes, least lately asked for first, each answer made once."""

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from service.queries import cache as caches
from service.queries.cache import AnswerCache, build_of, revision_and_json, shared_answer, to_json
from service.settings import CODE_VERSION
from storage import clutches
from storage.engine.database import Database
from storage.engine.errors import StorageUnavailable
from storage.engine.opening import open_database
from tests.storage.samples import clutch_row


@pytest.fixture(autouse=True)
def bodies_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Count bodies of a few bytes as what they are."""
    monkeypatch.setattr(caches, "KEPT_BESIDE_BYTES", 0)


def made(cache: AnswerCache, name: str, body: bytes) -> bool:
    """Whether the answer had to be made."""
    calls = []

    def make() -> bytes:
        calls.append(name)
        return body

    assert cache.answer(name, 1, make).body == body
    return bool(calls)


def test_the_least_lately_asked_for_goes_first_and_no_more_than_must() -> None:
    cache = AnswerCache(10)
    assert [made(cache, name, name.encode() * size) for name, size in (("a", 4), ("b", 4), ("c", 2))] == [True] * 3
    assert not made(cache, "a", b"aaaa")  # b is now the one not asked for longest
    assert made(cache, "d", b"ddd")
    assert [made(cache, "a", b"aaaa"), made(cache, "c", b"cc"), made(cache, "d", b"ddd")] == [False] * 3
    assert made(cache, "b", b"bbbb")
    cache = AnswerCache(8)
    assert [made(cache, name, b"four") for name in ("a", "b")] == [True] * 2
    assert cache.held("a", 1) is not None  # a poll counts as asking, too
    assert made(cache, "c", b"four")
    assert [cache.held(name, 1) is not None for name in ("a", "b", "c")] == [True, False, True]


def test_an_answer_larger_than_all_may_be_together_is_given_and_not_kept() -> None:
    cache = AnswerCache(10)
    assert made(cache, "small", b"s")
    assert [made(cache, "large", b"l" * 11) for _ in range(2)] == [True, True]
    assert not made(cache, "small", b"s")


def test_answers_without_a_body_take_room_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caches, "KEPT_BESIDE_BYTES", 10)
    cache = AnswerCache(100)
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
    cache, slow = AnswerCache(100), Slow()
    with ThreadPoolExecutor(4) as pool:
        first = pool.submit(cache.answer, "a", 1, slow)
        assert slow.started.wait(30)
        others = [pool.submit(cache.answer, "a", 1, slow) for _ in range(3)]
        assert cache.answer("b", 1, lambda: b"not held up").body == b"not held up"
        slow.release.set()
        assert {answer.result(30).body for answer in (first, *others)} == {b"slow"}
    assert slow.calls == 1


def test_of_a_key_one_version_is_held_and_counted() -> None:
    cache = AnswerCache(10)
    for version in range(20):
        assert cache.held("a", version) is None
        assert cache.answer("a", version, lambda: b"aaaa").body == b"aaaa"
        assert cache.held("a", version) is not None
        assert cache.held("a", version - 1) is None
    assert made(cache, "b", b"bbbb")
    assert cache.held("a", 19) is not None  # one answer's bytes are counted, not those of twenty


def test_a_slow_old_version_does_not_replace_a_newer_one() -> None:
    cache, old = AnswerCache(100), Slow()
    with ThreadPoolExecutor(1) as pool:
        slow = pool.submit(cache.answer, "a", 1, old)
        assert old.started.wait(30)
        new = cache.answer("a", 2, lambda: b"new")
        old.release.set()
        assert slow.result(30).body == b"slow"
    assert cache.held("a", 2) == new
    assert cache.answer("a", 3, lambda: b"newer") == cache.held("a", 3)


def test_what_fails_fails_for_all_and_is_tried_again() -> None:
    cache = AnswerCache(100)

    def failing() -> bytes:
        raise LookupError("not there")

    for _ in range(2):
        with pytest.raises(LookupError, match="not there"):
            cache.answer("a", 1, failing)
    assert cache.answer("a", 1, lambda: b"there").body == b"there"


def test_no_number_leaves_that_json_cannot_carry() -> None:
    assert to_json({"µ": 0.1}) == '{"µ":0.1}'.encode()
    with pytest.raises(ValueError, match="JSON"):
        to_json({"mean_cof": float("nan")})


def test_of_several_services_on_a_server_one_computes(on_server: Database) -> None:
    computed: list[str] = []

    def count(_: Database, clutch_id: str, *arguments: str) -> dict[str, int]:
        computed.append(clutch_id)
        return {"computed": len(computed), "arguments": len(arguments)}

    with on_server.writing() as connection:
        clutches.insert(connection, clutch_row("c1"))
    with closing(open_database(on_server.url)) as other:
        assert shared_answer(other, count, "c1") is None
        first = revision_and_json(on_server, count, "c1", ())
        assert first == (0, b'{"computed":1,"arguments":0}')
        assert revision_and_json(other, count, "c1", ()) == first
        assert shared_answer(other, count, "c1") == first
        with on_server.writing(of="c1") as connection:
            clutches.bump_revision(connection, "c1")
        assert shared_answer(other, count, "c1") == first
        assert revision_and_json(other, count, "c1", ()) == (1, b'{"computed":2,"arguments":0}')
        # with arguments, of which there are any number, nothing is kept
        assert revision_and_json(on_server, count, "c1", ("ukf",)) == (1, b'{"computed":3,"arguments":1}')
        assert revision_and_json(other, count, "c1", ("ukf",)) == (1, b'{"computed":4,"arguments":1}')
    assert len(computed) == 4


def test_another_build_of_the_release_computes_for_itself(on_server: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    def query(_: Database, clutch_id: str) -> dict[str, str]:
        return {"clutch_id": clutch_id, "computed_by": caches.BUILD}

    with on_server.writing() as connection:
        clutches.insert(connection, clutch_row("c1"))
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
    def query(database: Database, clutch_id: str) -> dict[str, str]:  # noqa: ARG001
        return {"clutch_id": clutch_id}

    def gone(*_: object) -> None:
        raise StorageUnavailable("the connection is gone")

    # as of a server that has just been restarted
    monkeypatch.setattr(in_file, "shared_answer", gone)
    monkeypatch.setattr(in_file, "share", gone)
    assert shared_answer(in_file, query, "c1") is None
    assert revision_and_json(in_file, query, "c1", ()) == (0, b'{"clutch_id":"c1"}')
    assert [record.levelname for record in caplog.records] == ["WARNING"] * 3
