"""What a connection may take before it has asked for anything: the server's own protocol, with bounds that it lacks.

The head of a request is bounded in bytes and lines (431), arguments (414) and time (408), trailers after its body too, and
one address has only so many connections: else whoever opens some hundreds and says nothing uses up the files that a process
may have open, and one that sends header lines without end fills its memory, before any key is looked at. A reader that does
not take a piece of its answer in time is cut off.
"""

import asyncio
import http
import resource
import struct
from socket import SO_LINGER, SO_SNDBUF, SOL_SOCKET
from typing import Any, NoReturn

from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from service.web.limits import (
    HEAD_SECONDS,
    LINGER_SECONDS,
    MAX_AHEAD,
    MAX_ARGUMENTS,
    MAX_HEAD_BYTES,
    MAX_HEAD_LINES,
    PIECE_BYTES,
    RETRY_AFTER_SECONDS,
    TAKEN_SECONDS,
)

#: Bytes of a header line beside its name and its value.
_SEPARATORS = len(": \r\n")
#: Bytes that the parser is given at once, but for a body's: what it keeps of them is not seen before the next.
_PIECE = 1 << 12
_HEAD_TOO_LARGE = (
    http.HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE,
    f"the head of a request may have at most {MAX_HEAD_BYTES} bytes and {MAX_HEAD_LINES} lines",
)
_TOO_MANY_ARGUMENTS = (
    http.HTTPStatus.REQUEST_URI_TOO_LONG,
    f"an address may have at most {MAX_ARGUMENTS} arguments",
)


def bounded(
    most: int, head_seconds: float = HEAD_SECONDS, taken_seconds: float = TAKEN_SECONDS
) -> type[asyncio.Protocol]:
    """A class of uvicorn's HTTP protocol with limits: at most `most` connections per address; a request's head must
    arrive within `head_seconds`, and the client must read written bytes of the response within `taken_seconds`."""

    class Bounded(HttpToolsProtocol):
        def __init__(self, config: Config, *arguments: Any, **more: Any) -> None:
            super().__init__(config, *arguments, **more)
            self._deadline: asyncio.TimerHandle | None = None
            self._taking: asyncio.TimerHandle | None = (
                None  # ends the connection unless what was written is taken before
            )
            self._head_bytes = 0  # of the request's lines that the parser has passed on, its trailers among them
            self._head_lines = 0
            self._url_marks = 0  # of the address, each before another argument
            self._held_bytes = 0  # that arrived since the parser passed anything on: it keeps what is unfinished
            self._in_head = False
            self._wrong: tuple[http.HTTPStatus, str] | None = None  # why the parsing was ended
            self._refused = False

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            """Refuse the connection if its address has too many, and limit what waits to be sent on it."""
            super().connection_made(transport)
            transport.set_write_buffer_limits(high=0)  # paused is: the reader has not taken all that was written
            line = transport.get_extra_info("socket")
            line.setsockopt(SOL_SOCKET, SO_SNDBUF, PIECE_BYTES)  # else the system takes megabytes for it
            others: set[Any] = self.connections  # of this protocol all of them
            addresses = [other.client[0] for other in others if other.client is not None]
            if self.client is not None and addresses.count(self.client[0]) > most:
                self._refuse(http.HTTPStatus.TOO_MANY_REQUESTS, f"one address may have {most} connections at once")
                return
            self._expect_head()

        def data_received(self, data: bytes) -> None:
            """Parse received bytes in pieces, and refuse a head that is too large."""
            in_body = self.cycle is not None and self.cycle.more_body
            step = len(data) if in_body else _PIECE
            for start in range(0, len(data), step):
                if self._refused or self.transport.is_closing():
                    return
                self._held_bytes += min(step, len(data) - start)
                super().data_received(data[start : start + step])
                if self._head_bytes + self._held_bytes > MAX_HEAD_BYTES:
                    self._refuse(*_HEAD_TOO_LARGE)
            if self._refused:
                return
            if self.cycle is None or self.cycle.response_complete:
                self._expect_head()
            else:
                self._end_deadline()

        def pause_writing(self) -> None:
            self._taking = self.loop.call_later(taken_seconds, self._cut_off)
            super().pause_writing()

        def resume_writing(self) -> None:
            self._end_taking()
            super().resume_writing()

        def connection_lost(self, exc: Exception | None) -> None:
            self._end_deadline()
            self._end_taking()
            super().connection_lost(exc)

        def on_message_begin(self) -> None:
            self._head_bytes = self._held_bytes = self._head_lines = self._url_marks = 0
            self._in_head = True
            super().on_message_begin()

        def on_url(self, url: bytes) -> None:
            self._count(len(url))
            self._url_marks += url.count(b"&")
            if self._url_marks >= MAX_ARGUMENTS:
                self._end_parsing(*_TOO_MANY_ARGUMENTS)
            super().on_url(url)

        def on_header(self, name: bytes, value: bytes) -> None:
            self._head_lines += 1
            self._count(len(name) + len(value) + _SEPARATORS)
            super().on_header(name, value)

        def on_headers_complete(self) -> None:
            self._in_head = False
            if len(self.pipeline) >= MAX_AHEAD:
                self._end_parsing(
                    http.HTTPStatus.TOO_MANY_REQUESTS, f"at most {MAX_AHEAD} requests may wait on one connection"
                )
            super().on_headers_complete()

        def on_body(self, body: bytes) -> None:
            self._held_bytes = 0
            super().on_body(body)

        def on_message_complete(self) -> None:
            self._head_bytes = self._held_bytes = self._head_lines = 0
            super().on_message_complete()

        def send_400_response(self, msg: str) -> None:
            if self._wrong is not None:
                self._refuse(*self._wrong)
            else:
                super().send_400_response(msg)

        def _count(self, size: int) -> None:
            self._held_bytes = 0
            self._head_bytes += size
            if self._head_bytes > MAX_HEAD_BYTES or self._head_lines > MAX_HEAD_LINES:
                self._end_parsing(*_HEAD_TOO_LARGE)

        def _end_parsing(self, status: http.HTTPStatus, text: str) -> NoReturn:
            """Raise an error inside the parser, which then calls `send_400_response`."""
            self._wrong = status, text
            raise ValueError(text)

        def _refuse(self, status: http.HTTPStatus, text: str) -> None:
            """Send a refusal, unless a response has begun, and close later: a socket closed with unread bytes loses the
            response."""
            if self._refused or self.transport.is_closing():
                return
            self._refused = True
            self._end_deadline()
            if self.cycle is None or self.cycle.response_complete or not self.cycle.response_started:
                if self.cycle is not None:
                    self.cycle.disconnected = True
                    self.cycle.message_event.set()
                retry = f"retry-after: {RETRY_AFTER_SECONDS}\r\n" if status == http.HTTPStatus.TOO_MANY_REQUESTS else ""
                self.transport.write(
                    f"HTTP/1.1 {status.value} {status.phrase}\r\ncontent-type: text/plain; charset=utf-8\r\n"
                    f"connection: close\r\n{retry}content-length: {len(text)}\r\n\r\n{text}".encode()
                )
                self.transport.write_eof()
            self._deadline = self.loop.call_later(LINGER_SECONDS, self.transport.close)

        def _expect_head(self) -> None:
            if self._deadline is None:
                self._deadline = self.loop.call_later(head_seconds, self._end_waiting)

        def _end_waiting(self) -> None:
            if self._in_head:
                text = f"the head of a request must be complete within {head_seconds:g} s"
                self._refuse(http.HTTPStatus.REQUEST_TIMEOUT, text)
            else:
                self.transport.close()

        def _cut_off(self) -> None:
            """Abort the connection: closed in order, the system would keep unread bytes for minutes."""
            linger = struct.pack("ii", 1, 0)
            self.transport.get_extra_info("socket").setsockopt(SOL_SOCKET, SO_LINGER, linger)
            self.transport.abort()

        def _end_taking(self) -> None:
            if self._taking is not None:
                self._taking.cancel()
                self._taking = None

        def _end_deadline(self) -> None:
            if self._deadline is not None:
                self._deadline.cancel()
                self._deadline = None

    return Bounded


def allow_many() -> None:
    """Raise this process's limit of open files to the system's maximum: each connection needs one."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
