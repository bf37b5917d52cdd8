"""HTTP/1.1 over one keep-alive connection, as little of it as a load needs: prepared bytes out, an answer back.

`Line` asks within an event loop, `Blocking` without one; both read answers with httptools, which the service has anyway.
"""

import asyncio
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import httptools

#: Bytes read at once by `Blocking`.
_CHUNK = 1 << 18
#: Seconds after which an idle connection is not used again: the server closes it after 5.
_IDLE = 2.0


class LostError(Exception):
    """No answer, or not the one that was needed: the connection could not be opened, or ended before the answer did."""


@dataclass(slots=True)
class Answer:
    """Status, headers by their lower-case names, and body."""

    status: int
    headers: dict[bytes, bytes]
    body: bytes

    @property
    def etag(self) -> str | None:
        """The entity tag as it was sent."""
        tag = self.headers.get(b"etag")
        return None if tag is None else tag.decode()


@dataclass(slots=True)
class Reading:
    """What httptools calls while an answer comes in; `done` is given the whole answer."""

    done: Callable[[Answer], None]
    parser: httptools.HttpResponseParser = field(init=False)
    _headers: dict[bytes, bytes] = field(init=False, default_factory=dict)
    _parts: list[bytes] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        self.parser = httptools.HttpResponseParser(self)

    def on_message_begin(self) -> None:
        self._headers, self._parts = {}, []

    def on_header(self, name: bytes, value: bytes) -> None:
        self._headers[name.lower()] = value

    def on_body(self, body: bytes) -> None:
        self._parts.append(body)

    def on_message_complete(self) -> None:
        self.done(Answer(self.parser.get_status_code(), self._headers, b"".join(self._parts)))


class _Protocol(asyncio.Protocol):
    """One connection's bytes; `waiting` is the question that has no answer yet."""

    def __init__(self) -> None:
        self.transport: asyncio.Transport | None = None
        self.waiting: asyncio.Future[Answer] | None = None
        self._reading = Reading(self._answered)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self._reading.parser.feed_data(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self.transport = None
        if self.waiting is not None and not self.waiting.done():
            self.waiting.set_exception(LostError(str(exc) if exc else "closed by the service"))

    def _answered(self, answer: Answer) -> None:
        if self.waiting is not None and not self.waiting.done():
            self.waiting.set_result(answer)


class Line:
    """A keep-alive connection that is opened when it is needed; one question at a time."""

    def __init__(self, port: int, timeout: float = 60.0) -> None:
        self._port, self._timeout = port, timeout
        self._protocol: _Protocol | None = None

    async def ask(self, request: bytes) -> Answer:
        """The answer to a prepared request. Raises LostError, TimeoutError."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(self._timeout):
                protocol = self._protocol
                if protocol is None or protocol.transport is None or protocol.transport.is_closing():
                    _, protocol = await loop.create_connection(_Protocol, "127.0.0.1", self._port)
                    self._protocol = protocol
                assert protocol.transport is not None
                protocol.waiting = loop.create_future()
                protocol.transport.write(request)
                answer = await protocol.waiting
        except TimeoutError:
            self.close()
            raise
        except OSError as error:
            raise LostError(str(error)) from error
        if answer.headers.get(b"connection", b"").lower() == b"close":
            self.close()
        return answer

    def close(self) -> None:
        """End the connection."""
        if self._protocol is not None and self._protocol.transport is not None:
            self._protocol.transport.abort()
        self._protocol = None


class Blocking:
    """A keep-alive connection that waits for its answers; opened again where it was idle so long that it may be closed."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._answers: list[Answer] = []
        self._open()

    def _open(self) -> None:
        self._socket = socket.create_connection(("127.0.0.1", self._port), timeout=60)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._reading = Reading(self._answers.append)
        self._used = time.monotonic()

    def ask(self, request: bytes) -> Answer:
        """The answer to a prepared request. Raises LostError."""
        if time.monotonic() > self._used + _IDLE:
            self.close()
            self._open()
        self._answers.clear()
        self._socket.sendall(request)
        while not self._answers:
            data = self._socket.recv(_CHUNK)
            if not data:
                raise LostError("closed by the service")
            self._reading.parser.feed_data(data)
        self._used = time.monotonic()
        return self._answers[0]

    def close(self) -> None:
        """End the connection."""
        self._socket.close()
