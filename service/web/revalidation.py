"""Answers that take a second to compute: made by a worker, once, and given as they were while a newer one is made.

The directive stale-while-revalidate of RFC 5861, decided by the service: where the workers are idle, who asks waits a while
for the newest answer; where they have more to do, the last one is given at once and its revision says of when it is.
`Prefer: wait=SECONDS` waits in any case.
"""

import asyncio
import logging
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass

from service.errors import BusyError
from service.queries.cache import Answer

#: What a worker returns: the revision that it computed the answer from, and the answer's bytes.
Made = tuple[int, bytes]
Compute = Callable[[bool], "Future[Made]"]

_log = logging.getLogger("clutchlife")


@dataclass(slots=True)
class _Entry:
    """The last answer and the revision that it is of; the making of the next, for those who wait and for later (`renewing`).

    Both may run at once: who waits does not wait for a renewal, which yields to all others.
    """

    revision: int = -1
    answer: Answer | None = None
    making: "asyncio.Task[None] | None" = None
    renewing: "asyncio.Task[None] | None" = None

    @property
    def is_made(self) -> bool:
        """Whether the next one is under way."""
        return self.making is not None or self.renewing is not None

    @property
    def size(self) -> int:
        """Bytes of the answer."""
        return 0 if self.answer is None else self.answer.size


class Revalidation:
    """The last answer by key; the least lately asked for goes first. Used from the event loop alone."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._held = 0
        self._entries: OrderedDict[Hashable, _Entry] = OrderedDict()

    def held(self, key: Hashable, revision: int) -> Answer | None:
        """The answer where it is of that very revision."""
        entry = self._entries.get(key)
        if entry is None or entry.revision != revision:
            return None
        self._entries.move_to_end(key)
        return entry.answer

    def knows(self, key: Hashable) -> bool:
        """Whether an answer is held, of whichever revision, or is being made."""
        return key in self._entries

    def begin(self, key: Hashable, revision: int, body: bytes) -> None:
        """Hold an answer that was made elsewhere, where none is known."""
        if key not in self._entries:
            self._put(key, _Entry(revision=revision, answer=Answer.of(body)))

    async def answer(self, key: Hashable, revision: int, compute: Compute, *, wait: float) -> tuple[int, Answer]:
        """The answer at `revision` or later, or the last one where it is not there within `wait` [s]; and its revision.

        Where none was ever made, it is waited for. `compute` is told whether who asks waits; what it raises is raised to
        those who do.
        """
        entry = self._entries.get(key, _Entry())
        deadline = asyncio.get_running_loop().time() + wait
        while True:
            answer = entry.answer
            if answer is not None and entry.revision >= revision:
                break
            if answer is None:
                await asyncio.shield(entry.making or self._begin(key, entry, compute, waits=True))
                continue
            making = entry.making
            if making is None and (wait > 0 or entry.renewing is None):
                try:
                    making = self._begin(key, entry, compute, waits=wait > 0)
                except BusyError:
                    if wait > 0:
                        raise
                    break
            left = deadline - asyncio.get_running_loop().time()
            if making is None or left <= 0 or not await _one_ends(making, entry.renewing, left):
                break
            if making.done():
                making.result()
        self._put(key, entry)
        return entry.revision, answer

    def _begin(self, key: Hashable, entry: _Entry, compute: Compute, *, waits: bool) -> "asyncio.Task[None]":
        """Have the next answer made, for one who waits or for later. Raises BusyError."""
        making = asyncio.create_task(self._make(key, entry, compute(waits), waits=waits))
        making.add_done_callback(_logged)
        self._put(key, entry)
        if waits:
            entry.making = making
        else:
            entry.renewing = making
        return making

    async def _make(self, key: Hashable, entry: _Entry, computing: "Future[Made]", *, waits: bool) -> None:
        try:
            revision, body = await asyncio.wrap_future(computing)
        except BaseException:
            if entry.answer is None:
                self._drop(key)
            raise
        finally:
            if waits:
                entry.making = None
            else:
                entry.renewing = None
        if revision < entry.revision:  # a later one was quicker
            return
        self._drop(key)
        entry.revision, entry.answer = revision, Answer.of(body)
        self._put(key, entry)

    def _put(self, key: Hashable, entry: _Entry) -> None:
        """Hold an entry as the one asked for last. To make room goes what nobody is making anew: it would be made twice."""
        self._drop(key)
        self._entries[key] = entry
        self._held += entry.size
        while self._held > self._most:
            oldest = next(
                (name for name, held in self._entries.items() if held.size > 0 and not held.is_made and name != key),
                None,
            )
            if oldest is None:
                break
            self._drop(oldest)

    def _drop(self, key: Hashable) -> None:
        dropped = self._entries.pop(key, None)
        if dropped is not None:
            self._held -= dropped.size


async def _one_ends(making: "asyncio.Task[None]", renewing: "asyncio.Task[None] | None", seconds: float) -> bool:
    """Wait until one of them ends, at most so long; whether one has."""
    running = [making] if renewing is None else [making, renewing]
    ended, _ = await asyncio.wait(running, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
    return bool(ended)


def _logged(made: "asyncio.Task[None]") -> None:
    """Who was given the last answer does not hear that the next one failed."""
    if not made.cancelled() and made.exception() is not None:
        _log.warning("an answer could not be computed anew: %s", made.exception())
