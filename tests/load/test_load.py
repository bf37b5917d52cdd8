"""The load generator itself: what it sends, what it counts, what it would miss."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from tests.load.__main__ import Options, run
from tests.load.beside import Beside, Processor
from tests.load.bodies import Post, SentLife, asked, life, posted
from tests.load.checks import lost_of
from tests.load.exchange import Answer, Line, LostError, Reading
from tests.load.field import ROUTES, Acknowledged, Counts, Field
from tests.load.report import Loaded, demands, growth, markdown, quantile

Handler = Callable[[bytes], Awaitable[bytes | None]]


async def stub(answer: Handler) -> tuple[asyncio.Server, int]:
    """A server that answers each request head with these bytes, or closes the connection at None; and its port."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while True:
                head = await reader.readuntil(b"\r\n\r\n")
                length = head.lower().partition(b"content-length:")[2].split(b"\r\n")[0]
                await reader.readexactly(int(length or 0))
                sent = await answer(head)
                if sent is None:
                    return
                writer.write(sent)
        except (asyncio.IncompleteReadError, ConnectionResetError):
            return
        finally:
            writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    return server, server.sockets[0].getsockname()[1]


def response(status: str, body: bytes = b"{}", *headers: str) -> bytes:
    head = "\r\n".join((f"HTTP/1.1 {status}", f"Content-Length: {len(body)}", *headers, "", ""))
    return head.encode() + body


def field_on(port: int, begin: float, seconds: float, *, lives: tuple[SentLife, ...] = (), rigs: int = 0) -> Field:
    return Field(
        ports=(port,), lives=lives, rigs=rigs, clients=0, seed=1, interval=0.0, begin=begin, end=begin + seconds
    )


def run_named(name: str) -> Post:
    return Post(run_id=name, kind="maintenance", content=b"{}")


# --- what is sent ---


def test_a_life_is_whole_and_the_same_for_a_seed(tmp_path: Path) -> None:
    own = life(3, tests=20)
    assert own == life(3, tests=20)
    assert own.posts != life(4, tests=20).posts
    kinds = [post.kind for post in own.posts]
    assert kinds.count("stationary_stribeck") == 20
    assert set(kinds) == {"run_in", "duty_cycles", "stationary_stribeck", "maintenance"}
    for post in own.posts:
        body = json.loads(post.content)
        assert (body["run_id"], body["kind"]) == (post.run_id, post.kind)
    # sampled records: raw files take the place of stationary tests, one post in ten; dynamic tests come beside them
    raw = life(3, raw=tmp_path, tests=20, samples=2_000)
    assert sum(post.kind == "dynamic_stribeck" for post in raw.posts) == 2
    assert [post.run_id for post in raw.posts if post.kind != "dynamic_stribeck"] == [post.run_id for post in own.posts]
    files = [post for post in raw.posts if post.raw]
    assert len(files) == 4
    assert {Path(str(post.path)).suffix for post in files} == {".gz", ".parquet"}


def test_a_request_says_how_long_it_is() -> None:
    assert posted("/x", b"{}", "text/csv", "Prefer: x").endswith(
        b"Content-Type: text/csv\r\nPrefer: x\r\nContent-Length: 2\r\n\r\n{}"
    )
    assert asked("/x", 'If-None-Match: "a"') == b'GET /x HTTP/1.1\r\nHost: localhost\r\nIf-None-Match: "a"\r\n\r\n'


# --- what comes back ---


def test_answers_are_read_in_any_pieces() -> None:
    sent = (
        response("200 OK", b"abc", 'ETag: "1"')
        + b'HTTP/1.1 304 Not Modified\r\nETag: "1"\r\n\r\n'
        + b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n2\r\nde\r\n1\r\nf\r\n0\r\n\r\n"
    )
    answers: list[Answer] = []
    reading = Reading(answers.append)
    for start in range(0, len(sent), 7):
        reading.parser.feed_data(sent[start : start + 7])
    assert [(each.status, each.etag, each.body) for each in answers] == [
        (200, '"1"', b"abc"),
        (304, '"1"', b""),
        (200, None, b"def"),
    ]


def test_a_lost_connection_is_an_error_and_the_next_question_opens_another() -> None:
    async def main() -> None:
        sent = iter([None, response("200 OK")])

        async def answer(_head: bytes) -> bytes | None:
            return next(sent)

        server, port = await stub(answer)
        line = Line(port)
        with pytest.raises(LostError):
            await line.ask(asked("/"))
        assert (await line.ask(asked("/"))).status == 200
        line.close()
        server.close()

    asyncio.run(main())


def test_a_service_that_stands_is_charged_for_all_that_was_to_be_asked() -> None:
    """One slow answer keeps a client's connection: its next question is late by what is left of it."""

    async def main() -> list[float]:
        loop = asyncio.get_running_loop()
        begin = loop.time()
        answered: list[bytes] = []

        async def answer(head: bytes) -> bytes:
            if not answered:
                await asyncio.sleep(begin + 1.5 - loop.time())  # it stands until then
            answered.append(head)
            return response("200 OK")

        server, port = await stub(answer)
        field = field_on(port, begin, 2.0)
        field.rigs, field.on_rigs = 1, ["c"]
        await field._client(0, 0.0, 0)
        server.close()
        return field.counts.gets[ROUTES[0]]

    first, second = asyncio.run(main())
    assert first >= 1.5 - 1e-6
    assert second >= 0.5 - 1e-6


def test_a_dashboard_names_the_answer_that_it_has_and_a_script_does_not() -> None:
    async def main(number: int) -> list[bytes]:
        heads: list[bytes] = []

        async def answer(head: bytes) -> bytes:
            heads.append(head)
            return response("200 OK", b"{}", 'ETag: "7"')

        server, port = await stub(answer)
        field = field_on(port, asyncio.get_running_loop().time() - 2.0, 2.0)  # all of it is due
        field.rigs, field.on_rigs = 1, ["c"]
        for part in range(len(ROUTES)):
            await field._client(number, 0.0, part)
        server.close()
        return heads

    dashboard, script = asyncio.run(main(0)), asyncio.run(main(1))
    assert {head.split()[1] for head in script} == {
        b"/v1/clutches/c/remaining-useful-life",
        b"/v1/clutches/c/degradation",
        b"/v1/clutches",
        b"/v1/clutches/c/runs",
    }
    assert [b'If-None-Match: "7"' in head for head in dashboard] == [False, True] * len(ROUTES)
    assert not any(b"If-None-Match" in head for head in script)


def test_a_refused_run_is_counted_and_sent_again() -> None:
    async def main() -> Counts:
        receipt = json.dumps({"run_id": "r", "content_sha256": "abc"}).encode()
        busy = response("503 Service Unavailable", b'{"detail": "too busy"}', "Retry-After: 0")
        sent = iter([response("201 Created"), busy, response("201 Created", receipt)])
        field = field_on(0, asyncio.get_running_loop().time(), 60.0, lives=(SentLife(seed=1, posts=(run_named("r"),)),))
        field.rigs, field.on_rigs = 1, [None]

        async def answer(_head: bytes) -> bytes | None:
            found = next(sent, None)
            if found is None:
                field.end = 0.0  # the life is over, and the time
            return found

        server, port = await stub(answer)
        field.ports = (port,)
        await field._rig(0, 0.0)
        server.close()
        return field.counts

    counts = asyncio.run(main())
    assert counts.problems.pop("POST plain: 503 too busy") == 1
    assert [(run.post.run_id, run.sha256) for run in counts.acknowledged["load-0-000"]] == [("r", "abc")]
    assert len(counts.posts["plain"]) == 2


# --- what is made of it ---


def test_quantiles_are_values_that_were_seen() -> None:
    values = [float(number) for number in range(1, 101)]
    assert [quantile(values, share) for share in (0.5, 0.9, 0.99, 1.0)] == [50.0, 90.0, 99.0, 100.0]
    assert quantile([3.0], 0.01) == 3.0
    assert quantile([], 0.5) == float("inf")


def test_growth_is_that_of_the_last_third() -> None:
    assert growth([1, 2, 3, 100, 100, 100, 110, 110, 110]) == pytest.approx(1.1)
    assert growth([5, 6]) == 1.0


def test_what_is_lost_changed_or_added_is_noticed() -> None:
    own = [Acknowledged(post=run_named(name), sha256=name * 2) for name in ("a", "b")]
    assert lost_of("c", own, {"a": "aa", "b": "bb"}) == []
    assert lost_of("c", own, {"a": "aa", "b": "bb", "x": "xx"}, {("c", "x")}) == []
    assert len(lost_of("c", own, {"a": "aa", "b": "bb", "x": "xx"})) == 1
    assert len(lost_of("c", own, {"a": "aa"})) == 1
    assert len(lost_of("c", own, {"a": "aa", "b": "bx"})) == 1


def found(*, get: float = 0.01, post: float = 0.1, runs: int = 20, memory: int = 100, raw: bool = False) -> Loaded:
    """What a load of one second might come to."""
    counts = Counts()
    for route in ROUTES:
        counts.gets[route] = [0.001]
    counts.gets["runs"], counts.posts["plain"] = [get], [post]
    counts.acknowledged["c"] = [Acknowledged(post=run_named(str(number)), sha256="") for number in range(runs)]
    noted = Beside(alone=[100, 100, memory], together=[100, 100, 100])
    nothing = Processor(generator=0.0, service=0.0, refreshes=0.0, others=0.0)
    return Loaded(seconds=1.0, raw=raw, counts=counts, beside=noted, processor=nothing, losses=[])


def test_each_demand_can_fail_by_itself() -> None:
    def unmet(loaded: Loaded) -> list[str]:
        assert "**no**" in markdown(loaded) or all(each.met for each in demands(loaded))
        return [each.name.split()[0] for each in demands(loaded) if not each.met]

    assert unmet(found()) == []
    assert unmet(found(get=0.06)) == ["GET"]
    assert unmet(found(post=0.6)) == ["POST"]
    assert unmet(found(runs=10)) == ["at"]
    assert unmet(found(runs=10, raw=True)) == []
    assert unmet(found(memory=120)) == ["memory"]
    refused = found()
    refused.counts.problems["GET runs: 503 busy"] = 1
    assert unmet(refused) == ["no"]


# --- all of it ---


@pytest.mark.slow
def test_a_small_load_has_no_error_and_loses_nothing(tmp_path: Path) -> None:
    # the first test of the first life of this seed is a raw file
    options = Options(seconds=4.0, rigs=3, clients=3, seed=4, raw=True, tests=6, samples=2_000, states=2, loaded=True)
    loaded = run(options, tmp_path)
    assert not loaded.problems
    assert list(loaded.losses) == []
    assert loaded.counts.kinds["raw file"] > 0
    assert all(loaded.counts.gets[route] for route in ROUTES)
    assert loaded.beside.refreshes
    assert min(loaded.beside.alone) > 0
