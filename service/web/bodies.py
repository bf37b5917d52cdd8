"""Bodies of requests: what a route takes, what all may hold together, how long one may take, and where it is kept.

A route that takes more than short JSON says so where it stands (`takes`); what is not declared is short. Bytes are counted
while they are held: what has no room is refused with 503.
"""

import asyncio
import tempfile
from collections.abc import AsyncIterable, AsyncIterator, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import IO, Any, TypeVar

from fastapi import Request
from fastapi.concurrency import contextmanager_in_threadpool, run_in_threadpool
from pydantic import BaseModel
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.errors import BusyError, TooLargeError, TooSlowError
from service.runs.json_run import checked
from service.web import limits

Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])


class Takes(Enum):
    """The kinds of request body that a route may accept."""

    SHORT = "JSON of a few fields"
    RUN = "a run as JSON, which waits on disk where it is long"
    PHOTOGRAPH = "a photograph, in memory"
    FILE = "a file, on disk"


#: What routes' functions take that is not short JSON.
declared: dict[Callable[..., Any], Takes] = {}


def takes(kind: Takes) -> Callable[[Endpoint], Endpoint]:
    """Decorator that states which kind of request body a route function accepts."""

    def declare(endpoint: Endpoint) -> Endpoint:
        declared[endpoint] = kind
        return endpoint

    return declare


Content = TypeVar("Content", bound=BaseModel)


async def parsed(schema: type[Content], body: bytes) -> Content:
    """A body of JSON checked by its schema, a long one in a thread. Raises InvalidError, which names every wrong place."""
    if len(body) <= limits.MAX_CHECKED_BYTES:
        return checked(schema, body)
    return await run_in_threadpool(checked, schema, body)


@asynccontextmanager
async def body_or_file(request: Request, folder: Path) -> AsyncIterator[bytes | Path]:
    """Context with a request's body: in memory if short, else as a file in the folder, removed at the end."""
    pieces, received = request.stream(), bytearray()
    async for piece in pieces:
        received += piece
        if len(received) > limits.MAX_BYTES_IN_MEMORY:
            break
    else:
        yield bytes(received)
        return
    async with contextmanager_in_threadpool(tempfile.NamedTemporaryFile(dir=folder)) as file:
        await run_in_threadpool(file.write, received)
        received.clear()
        await written(pieces, file)
        yield Path(file.name)


async def written(pieces: AsyncIterable[bytes], file: IO[bytes]) -> None:
    """Write the pieces to the file as they arrive, in a thread."""
    gathered = bytearray()
    async for piece in pieces:
        gathered += piece
        if len(gathered) >= limits.PIECE_BYTES:
            await run_in_threadpool(file.write, bytes(gathered))
            gathered.clear()
    await run_in_threadpool(_end, file, bytes(gathered))


def _end(file: IO[bytes], last: bytes) -> None:
    file.write(last)
    file.flush()


class Room:
    """A budget of bytes that requests share."""

    def __init__(self, most: int) -> None:
        self.left = most
        self._sharing: dict[int, int] = {}  # how many hold the same object, by its id

    def take(self, size: int) -> bool:
        """Reserve this many bytes (release them if negative); false, with nothing reserved, if they exceed the budget."""
        if size > self.left:
            return False
        self.left -= size
        return True

    @contextmanager
    def sharing(self, content: bytes) -> Iterator[bool]:
        """Context that reserves an object's bytes, counted once for all its users; yields whether they fit into the
        budget."""
        held = id(content) in self._sharing or self.take(len(content))
        if held:
            self._sharing[id(content)] = self._sharing.get(id(content), 0) + 1
        try:
            yield held
        finally:
            if held:
                self._sharing[id(content)] -= 1
                if not self._sharing[id(content)]:
                    del self._sharing[id(content)]
                    self.take(-len(content))


@dataclass(frozen=True, slots=True)
class Bound:
    """The maximum size of a body [bytes], and the part of it that is kept in memory; the rest is on disk."""

    most: int
    in_memory: int


def _too_large(bound: Bound) -> TooLargeError:
    return TooLargeError(f"a request may hold at most {bound.most} bytes here")


class Bodies:
    """Limits request bodies: 413 if the body exceeds its route's size limit, announced or actual; 408 if it takes
    longer than `seconds` plus the time allowed for its bytes so far; 503 if other bodies use all available room.

    A body refused with 503 is first read to its end and discarded: a sender reads the answer only then.
    """

    def __init__(self, app: ASGIApp, most: int, most_file: int, seconds: float) -> None:
        self.app = app
        short = min(most, limits.MAX_SHORT_BODY_BYTES)
        self.bounds: Mapping[Takes, Bound] = {
            Takes.SHORT: Bound(short, short),
            Takes.RUN: Bound(most, limits.MAX_BYTES_IN_MEMORY),
            Takes.PHOTOGRAPH: Bound(most, most),
            Takes.FILE: Bound(most_file, limits.PIECE_BYTES),
        }
        self.rooms = {"memory": Room(limits.MAX_BODIES_IN_MEMORY), "disk": Room(2 * max(most, most_file))}
        self.seconds = seconds

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        body = _RequestBody(self.rooms)
        begun: float | None = None
        whole = False
        clock = asyncio.get_running_loop().time

        async def arrived(begun: float) -> Message:
            left = begun + self.seconds + body.taken / limits.SLOWEST_BODY_BYTES_PER_SECOND - clock()
            try:
                async with asyncio.timeout(left):
                    return await receive()
            except TimeoutError:
                raise TooSlowError(f"only {body.taken} bytes of the body arrived in {clock() - begun:.0f} s") from None

        async def counted() -> Message:
            """The next message of the body, counted against the limits."""
            nonlocal begun, whole
            if whole:  # what comes now is that the caller has gone
                return await receive()
            bound = self.bounds[declared.get(scope.get("endpoint", self), Takes.SHORT)]
            if begun is None:
                begun = clock()
                announced = dict(scope["headers"]).get(b"content-length", b"0")
                if announced.isdigit() and int(announced) > bound.most:
                    raise _too_large(bound)
            while True:
                message = await arrived(begun)
                whole = not message.get("more_body", False)
                has_room = body.grow(len(message.get("body", b"")), bound.in_memory)
                if body.taken > bound.most:
                    raise _too_large(bound)
                if has_room:
                    return message
                if whole:
                    raise BusyError("the bodies of other requests use all available room: try again later")

        try:
            await self.app(scope, counted, send)
        finally:
            body.leave()


class _RequestBody:
    """The bytes received of one request's body, and its reservations in memory and on disk."""

    def __init__(self, rooms: Mapping[str, Room]) -> None:
        self.taken = 0
        self._rooms = rooms
        self._held = dict.fromkeys(rooms, 0)
        self._has_room = True

    def grow(self, size: int, in_memory: int) -> bool:
        """Count more received bytes and reserve room for them; false, with all its room released, once there is none."""
        self.taken += size
        if self._has_room:
            needed = {"memory": min(self.taken, in_memory), "disk": max(0, self.taken - in_memory)}
            self._has_room = all(self._hold(place, size) for place, size in needed.items())
            if not self._has_room:
                self.leave()
        return self._has_room

    def leave(self) -> None:
        for place in self._held:
            self._hold(place, 0)

    def _hold(self, place: str, size: int) -> bool:
        """Reserve this many bytes in memory or on disk; false if there is no room."""
        has_room = self._rooms[place].take(size - self._held[place])
        self._held[place] = size if has_room else self._held[place]
        return has_room
