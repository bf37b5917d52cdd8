"""Answers that take a second to compute: made by a worker, once, and given as they were while a newer one is made.

As stale-while-revalidate of RFC 5861: where the workers are idle, who asks waits a while for the newest answer; where they
have more to do, the last one is given at once. `Prefer: wait=SECONDS` waits in any case.
"""

import asyncio
import logging
from collections.abc import Callable, Hashable
from concurrent.futures import Future

from service.errors import BusyError
from service.queries.cache import Answer, AnswerCache

#: What a worker returns: the revision that it computed the answer from, and the answer's bytes.
Made = tuple[int, bytes]
Compute = Callable[[bool], "Future[Made]"]
_Making = asyncio.Task[tuple[int, Answer]]

_log = logging.getLogger("clutchlife")


class Revalidation:
    """Has the next answers made that the cache holds by clutch and revision. Used from the event loop alone.

    Of a key one may be made for those who wait and one for later, both at once: who waits does not wait for a renewal, which
    yields to all others.
    """

    def __init__(self, cache: AnswerCache) -> None:
        self._cache = cache
        self._making: dict[Hashable, _Making] = {}
        self._renewing: dict[Hashable, _Making] = {}

    def knows(self, key: Hashable) -> bool:
        """Whether an answer is held, of whichever revision, or is being made."""
        return key in self._making or key in self._renewing or key in self._cache

    def begin(self, key: Hashable, revision: int, body: bytes) -> None:
        """Hold an answer that was made elsewhere, where none is known."""
        if not self.knows(key):
            self._cache.put(key, revision, Answer.of(body))

    async def answer(self, key: Hashable, revision: int, compute: Compute, *, wait: float) -> tuple[int, Answer]:
        """The answer at `revision` or later, or the last one where it is not there within `wait` [s]; and its revision.

        Where none was ever made, it is waited for. `compute` is told whether who asks waits; what it raises is raised to
        those who do.
        """
        deadline = asyncio.get_running_loop().time() + wait
        newest = self._cache.newest(key)
        while newest is None or newest[0] < revision:
            making, renewing = self._making.get(key), self._renewing.get(key)
            if newest is None:
                newest = await asyncio.shield(making or self._begin(key, compute, waits=True))
                continue
            if making is None and (wait > 0 or renewing is None):
                try:
                    making = self._begin(key, compute, waits=wait > 0)
                except BusyError:
                    if wait > 0:
                        raise
                    break
            left = deadline - asyncio.get_running_loop().time()
            if making is None or left <= 0:
                break
            running = [task for task in (making, renewing) if task is not None]
            ended, _ = await asyncio.wait(running, timeout=left, return_when=asyncio.FIRST_COMPLETED)
            if not ended:
                break
            results = [task.result() for task in ended if task is making or not _failed(task)]
            newest = max([newest, *results], key=lambda answered: answered[0])
        return newest

    def _begin(self, key: Hashable, compute: Compute, *, waits: bool) -> _Making:
        """Have the next answer made, for one who waits or for later. Raises BusyError."""
        tasks = self._making if waits else self._renewing
        task = tasks[key] = asyncio.create_task(self._make(key, compute(waits), tasks))
        self._cache.pinned.add(key)
        task.add_done_callback(_logged)
        return task

    async def _make(
        self, key: Hashable, computing: "Future[Made]", tasks: dict[Hashable, _Making]
    ) -> tuple[int, Answer]:
        try:
            revision, body = await asyncio.wrap_future(computing)
        finally:
            del tasks[key]
            if key not in self._making and key not in self._renewing:
                self._cache.pinned.discard(key)
        cached = self._cache.newest(key)
        if cached is not None and revision < cached[0]:  # a later one was quicker
            return cached
        result = revision, Answer.of(body)
        self._cache.put(key, *result)
        return result


def _failed(task: _Making) -> bool:
    return task.cancelled() or task.exception() is not None


def _logged(task: _Making) -> None:
    """Log a failed renewal: the caller has already got the previous answer and does not see the error."""
    if not task.cancelled() and task.exception() is not None:
        _log.warning("an answer could not be computed again: %s", task.exception())
