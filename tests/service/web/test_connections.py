"""Who opens connections and says nothing cannot keep others from being answered."""

import asyncio
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx2
import pytest
from starlette.types import Receive, Scope, Send
from uvicorn.config import Config
from uvicorn.server import ServerState

from service.web.connections import bounded
from tests.lab.benchmarks.memory import resident
from tests.support import ONCE, serving, stationary

BEGUN = b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: a"
OTHER_ADDRESS = "127.0.0.2"


@contextmanager
def connections(port: int, number: int, begun: bytes, address: str = OTHER_ADDRESS) -> Iterator[list[socket.socket]]:
    """So many connections from an address, each of which has sent no more than `begun`."""
    with ExitStack() as stack:
        held = []
        for _ in range(number):
            line = stack.enter_context(
                socket.create_connection(("127.0.0.1", port), timeout=10, source_address=(address, 0))
            )
            line.sendall(begun)
            held.append(line)
        yield held


@pytest.mark.parametrize("begun", [b"", BEGUN], ids=["nothing", "half a head"])
def test_connections_that_say_nothing_leave_others_their_own(tmp_path: Path, begun: bytes) -> None:
    with serving(tmp_path / "a.db", loaded=True, environment={"CLUTCHLIFE_CONNECTIONS_AT_ONCE": "20"}) as server:
        with connections(server.port, 21, begun) as held:
            refused = held[-1].recv(65536)
            assert refused.startswith(b"HTTP/1.1 429")
            assert b"retry-after: 1\r\n" in refused
            assert refused.endswith(b"one address may have 20 connections at once")
            assert ONCE.get(f"{server.url}/livez").status_code == 200
            assert ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
            assert ONCE.post(f"{server.url}/v1/clutches/c1/runs", json=stationary(0.0)).status_code == 201
        until = time.monotonic() + 10
        while time.monotonic() < until:  # the server sees that they have gone
            with connections(server.port, 1, b"GET /livez HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n") as (line,):
                if (answer := line.recv(65536)).startswith(b"HTTP/1.1 200"):
                    break
        assert answer.startswith(b"HTTP/1.1 200"), "and who has closed them may come again"


async def app(_scope: Scope, _receive: Receive, send: Send) -> None:
    """Answers at once, without the body."""
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"ok"})


async def until_closed(sent: list[bytes], pause: float, *, head: float) -> tuple[bytes, int, float]:
    """What is answered to pieces that are sent a pause apart where a head has so many seconds; how many of them are left
    when the server closes, and after how many seconds it does."""
    config = Config(log_config=None, app=app, http=bounded(9, head), lifespan="off", timeout_keep_alive=60)
    config.load()
    state = ServerState()
    loop = asyncio.get_running_loop()
    factory: Any = config.http_protocol_class
    server = await loop.create_server(lambda: factory(config=config, server_state=state, app_state={}), "127.0.0.1", 0)
    async with server:
        reader, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
        begun = loop.time()
        reading = asyncio.create_task(reader.read())
        for left in reversed(range(len(sent))):
            writer.write(sent[-1 - left])
            await asyncio.wait([reading], timeout=pause)
            if reading.done():
                break
        answered = await asyncio.wait_for(reading, 50)
        writer.close()
        return answered, left, loop.time() - begun


WHOLE = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"


TRICKLE = [b"GET / HTTP/1.1\r\n", *[b"X: a\r\n"] * 90]
LONG = b"GET / HTTP/1.1\r\nX: " + b"a" * 60_000 + b"\r\n\r\n"
#: What is sent, how many requests of it are answered, and what is said before the connection is closed.
CLOSED: dict[str, tuple[list[bytes], int, bytes]] = {
    "nothing": ([b""], 0, b""),
    "a head that trickles in": (TRICKLE, 0, b"408"),
    "a second head that trickles in": ([WHOLE, *TRICKLE], 1, b""),
    "a body after its answer": ([b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 100\r\n\r\n", *[b"a"] * 90], 1, b""),
    "60 KiB of a head": ([LONG[:50_000], LONG[50_000:], b"GET / "], 1, b""),
    "a long address": ([b"GET /" + b"a" * 70_000], 0, b"431"),
    "one long line": ([b"GET / HTTP/1.1\r\nX: ", *[b"a" * 30_000] * 9], 0, b"431"),
    "lines at once": ([b"GET / HTTP/1.1\r\n" + b"X: a\r\n" * 12_000 + b"\r\n"], 0, b"431"),
    "lines": ([b"GET / HTTP/1.1\r\n" + b"X: a\r\n" * 6_000, b"X: a\r\n" * 6_000], 0, b"431"),
    "100 lines": ([b"GET / HTTP/1.1\r\n" + b"X:\r\n" * 100 + b"\r\n", b"GET / "], 1, b""),
    "101 lines": ([b"GET / HTTP/1.1\r\n" + b"X:\r\n" * 101 + b"\r\n"], 0, b"431"),
    "100 arguments": ([b"GET /?" + b"&".join([b"a"] * 100) + b" HTTP/1.1\r\n\r\n", b"GET / "], 1, b""),
    "101 arguments": ([b"GET /?a&" + b"a&" * 50, b"a&" * 49 + b"a HTTP/1.1\r\n\r\n"], 0, b"414"),
    "a second head that is long": ([WHOLE, b"GET / HTTP/1.1\r\nX: " + b"a" * 70_000], 1, b"431"),
    "empty lines": ([b"\r\n" * 70_000], 0, b"431"),
}


@pytest.mark.parametrize("case", CLOSED)
def test_a_connection_whose_head_is_slow_long_or_missing_is_closed(case: str) -> None:
    sent, answers, refusal = CLOSED[case]
    answered, left, seconds = asyncio.run(until_closed(sent, 0.1, head=0.5))
    assert answered.count(b"HTTP/1.1 200") == answers
    assert left > 0 or len(sent) < 9, "it takes what comes, however slowly"
    if refusal:
        assert b"HTTP/1.1 " + refusal in answered
        assert b"connection: close" in answered
    if refusal not in (b"431", b"414"):
        assert seconds > 0.4


#: What one connection sends before any key is asked for: how it begins, and what it goes on with.
ENDLESS = {
    "header lines": (b"GET / HTTP/1.1\r\n", b"X-Line: abcdefghijklmnop\r\n"),
    "one header line": (b"GET / HTTP/1.1\r\nX-Line: ", b"abcdefghijklmnop"),
    "an address": (b"GET /", b"abcdefghijklmnop"),
    "trailers": (
        b"POST /v1/clutches HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n1\r\na\r\n0\r\n",
        b"X-Line: abcdefghijklmnop\r\n",
    ),
    "requests ahead": (b"", b"GET /v1/clutches HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"),
}


def test_what_one_connection_sends_before_any_key_is_asked_for_is_not_kept(tmp_path: Path) -> None:
    """64 MiB of each, as long as the service reads: 240 MiB of header lines were all kept."""
    with serving(tmp_path / "a.db", loaded=True) as server:
        assert ONCE.get(f"{server.url}/v1/clutches").status_code == 200
        before = resident(server.pid)
        for name, (begun, going_on) in ENDLESS.items():
            piece = going_on * (2**20 // len(going_on))
            with socket.create_connection(("127.0.0.1", server.port), timeout=30) as line:
                line.sendall(begun)
                with suppress(ConnectionError):  # it is closed while it sends
                    for _ in range(64):
                        line.sendall(piece)
                assert resident(server.pid) - before < 24 << 20, name
        assert ONCE.get(f"{server.url}/livez").status_code == 200


def test_a_connection_that_goes_on_asking_stays_open() -> None:
    """Twelve requests over twice as long as one head may take."""
    answered, _, seconds = asyncio.run(until_closed([WHOLE] * 12 + [b"GET / "], 0.12, head=0.7))
    assert answered.count(b"HTTP/1.1 200") == 12
    assert seconds > 1.4


def test_a_connection_stays_usable_after_head(tmp_path: Path) -> None:
    """A body that was announced and sent would be read as the next answer."""
    with serving(tmp_path / "a.db", loaded=True) as server, httpx2.Client(base_url=server.url, timeout=30) as http:
        for _ in range(3):
            head = http.head("/v1/clutches")
            assert (head.status_code, head.content) == (200, b"")
            assert int(head.headers["content-length"]) > 0
            assert http.get("/v1/clutches").json() == {"items": [], "next": None}


async def seconds_until_cut_off(pause: float, reads: int, window: int) -> float:
    """When the server cuts off who asks for 64 MiB in pieces that may take half a second each, and reads one a pause."""
    ended = asyncio.Event()

    async def answer(_scope: Scope, _receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"%d" % (64 << 20))]})
        for number in range(256):
            await send({"type": "http.response.body", "body": b"a" * (1 << 18), "more_body": number < 255})
        ended.set()

    config = Config(log_config=None, app=answer, http=bounded(9, taken_seconds=0.5), lifespan="off")
    config.load()
    loop = asyncio.get_running_loop()
    factory: Any = config.http_protocol_class
    state = ServerState()
    server = await loop.create_server(lambda: factory(config=config, server_state=state, app_state={}), "127.0.0.1", 0)
    async with server:
        with socket.socket() as line:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, window)
            line.connect(server.sockets[0].getsockname())
            line.sendall(WHOLE)
            begun = loop.time()
            for _ in range(reads):
                await asyncio.sleep(pause)
                left = 1 << 18
                while left > 0 and (taken := await asyncio.to_thread(line.recv, left)):
                    left -= len(taken)
                assert not ended.is_set(), "it reads"
            await asyncio.wait_for(ended.wait(), 10)
            return loop.time() - begun


def test_a_reader_that_takes_nothing_is_cut_off() -> None:
    """It held its answer as long as it liked."""
    assert 0.4 < asyncio.run(seconds_until_cut_off(0.0, 0, 1 << 12)) < 3


def test_a_reader_that_takes_its_pieces_slowly_is_not_cut_off() -> None:
    assert asyncio.run(seconds_until_cut_off(0.2, 8, 1 << 18)) > 1.6
