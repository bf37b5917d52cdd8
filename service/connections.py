"""What a connection may take before it has asked for anything: the server's own protocol, with two bounds that it lacks.

A connection that has not sent the head of a request in time is closed, and one address has only so many: else who opens some
hundreds and says nothing uses up the files that the process may have open, and nobody is answered any more.
"""

import asyncio
import resource
from typing import Any

from uvicorn.config import HTTP_PROTOCOLS, Config
from uvicorn.importer import import_from_string

from service.web.limits import HEAD_SECONDS, RETRY_AFTER_SECONDS

_REFUSAL = (
    "HTTP/1.1 429 Too Many Requests\r\ncontent-type: text/plain; charset=utf-8\r\nconnection: close\r\n"
    f"retry-after: {RETRY_AFTER_SECONDS}\r\ncontent-length: {{}}\r\n\r\n{{}}"
)


def bounded(most: int, head_seconds: float = HEAD_SECONDS) -> type[asyncio.Protocol]:
    """The protocol that uvicorn takes by itself, with at most `most` connections of one address, each of which has sent the
    head of its first request, and of every further one that it begins, after `head_seconds`."""
    base: Any = import_from_string(HTTP_PROTOCOLS["auto"])

    class Bounded(base):  # type: ignore[misc]
        def __init__(self, config: Config, *arguments: Any, **more: Any) -> None:
            super().__init__(config, *arguments, **more)
            self._deadline: asyncio.TimerHandle | None = None

        def connection_made(self, transport: asyncio.Transport) -> None:
            super().connection_made(transport)
            if self.client is not None and _held_by(self.client[0], self.connections) > most:
                text = f"one address may have {most} connections at once"
                transport.write(_REFUSAL.format(len(text), text).encode())
                transport.close()
                return
            self._expect_head()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self.cycle is None or self.cycle.response_complete:
                self._expect_head()
            else:
                self._end_deadline()

        def connection_lost(self, exc: Exception | None) -> None:
            self._end_deadline()
            super().connection_lost(exc)

        def _expect_head(self) -> None:
            if self._deadline is None:
                self._deadline = self.loop.call_later(head_seconds, self.transport.close)

        def _end_deadline(self) -> None:
            if self._deadline is not None:
                self._deadline.cancel()
                self._deadline = None

    return Bounded


def _held_by(address: str, connections: set[Any]) -> int:
    return sum(other.client is not None and other.client[0] == address for other in connections)


def allow_many() -> None:
    """Let this process have as many files open as the system lets it: every connection is one."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
