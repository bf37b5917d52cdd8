"""HTTP/1.1 over one keep-alive connection, as little of it as a load needs: prepared bytes out, an answer back.

`Line` asks within an event loop, `Blocking` without one; both read answers with httptools, which the service has anyway.
"""

import asyncio
import socket
import time
from dataclasses import dataclass

import httptools

#: Bytes read at once.
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


class Reading:
    """What httptools calls while an answer comes in; `answer` is the whole of it."""

    def __init__(self) -> None:
        self.parser = httptools.HttpResponseParser(self)
        self.answer: Answer | None = None
        self._headers: dict[bytes, bytes] = {}
        self._parts: list[bytes] = []

    def on_header(self, name: bytes, value: bytes) -> None:
        self._headers[name.lower()] = value

    def on_body(self, body: bytes) -> None:
        self._parts.append(body)

    def on_message_complete(self) -> None:
        self.answer = Answer(self.parser.get_status_code(), self._headers, b"".join(self._parts))

    def feed(self, data: bytes) -> None:
        """Take what has come in. Raises LostError where nothing has."""
        if not data:
            raise LostError("closed by the service")
        self.parser.feed_data(data)


class Line:
    """A keep-alive connection that is opened when it is needed; one question at a time."""

    def __init__(self, port: int, timeout: float = 60.0) -> None:
        self._port, self._timeout = port, timeout
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def ask(self, request: bytes) -> Answer:
        """The answer to a prepared request. Raises LostError, TimeoutError."""
        reading = Reading()
        try:
            async with asyncio.timeout(self._timeout):
                if self._streams is None or self._streams[0].at_eof() or self._streams[1].is_closing():
                    self.close()
                    self._streams = await asyncio.open_connection("127.0.0.1", self._port)
                reader, writer = self._streams
                writer.write(request)
                while reading.answer is None:
                    reading.feed(await reader.read(_CHUNK))
        except (TimeoutError, LostError):
            self.close()
            raise
        except OSError as error:
            self.close()
            raise LostError(str(error)) from error
        if reading.answer.headers.get(b"connection", b"").lower() == b"close":
            self.close()
        return reading.answer

    def close(self) -> None:
        """End the connection."""
        if self._streams is not None:
            self._streams[1].transport.abort()
        self._streams = None


class Blocking:
    """A keep-alive connection that waits for its answers; opened again where it was idle so long that it may be closed."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._open()

    def _open(self) -> None:
        self._socket = socket.create_connection(("127.0.0.1", self._port), timeout=60)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._used = time.monotonic()

    def ask(self, request: bytes) -> Answer:
        """The answer to a prepared request. Raises LostError."""
        if time.monotonic() > self._used + _IDLE:
            self.close()
            self._open()
        self._socket.sendall(request)
        reading = Reading()
        while reading.answer is None:
            reading.feed(self._socket.recv(_CHUNK))
        self._used = time.monotonic()
        return reading.answer

    def close(self) -> None:
        """End the connection."""
        self._socket.close()
