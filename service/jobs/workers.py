"""Work outside the process that answers: calls of `function(database, ...)` in lanes of worker processes.

A lane holds what may take equally long, so that a file of a million samples or an answer that takes seconds delays nothing
that is quick. Calls that change the same clutch take turns, since one would be computed in vain.
The same calls can run in threads of the process itself (`in_threads`); both give the same.
"""

import multiprocessing
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from service.errors import BusyError
from service.jobs import worker
from storage.engine.database import Database

#: Calls of a lane that wait or run; more are refused as busy. Chosen: a minute of runs at 15 a second is 900.
_MOST_WAITING = 256


class Lane(Enum):
    """What waits for what: runs that are taken in, files and raw records, and answers that are computed.

    The values are by how much a lane's processes yield to the one that answers [nice]. Chosen by `make load`.
    """

    RUNS = 1
    FILES = 5
    ANSWERS = 10


@dataclass(slots=True)
class _Call:
    """A call on its way; `retried` once its process ended without an answer."""

    lane: Lane
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    turn: str | None
    answer: "Future[Any]" = field(default_factory=Future)
    retried: bool = False


class Workers:
    """The lanes. `submit` from any thread; `close` at the end."""

    def __init__(self, make: Callable[[Lane], Executor], wrap: Callable[..., Any], sizes: dict[Lane, int]) -> None:
        self._make = make
        self._wrap = wrap
        self._sizes = sizes
        self._pools: dict[Lane, Executor] = {}
        self._calls = dict.fromkeys(Lane, 0)
        self._turns: dict[str, deque[_Call]] = {}
        self._lock = threading.Lock()
        self._closed = False

    def submit(
        self, lane: Lane, function: Callable[..., Any], *arguments: Any, turn: str | None = None
    ) -> "Future[Any]":
        """Have `function(database, *arguments)` called; calls of the same `turn` run one after the other.

        Function, arguments and result must be picklable. Raises BusyError where too many wait.
        """
        asked = _Call(lane, function, arguments, turn)
        asked.answer.set_running_or_notify_cancel()  # nobody who stops waiting stops what is stored
        with self._lock:
            if self._closed or self._calls[lane] >= _MOST_WAITING:
                raise BusyError(f"{self._calls[lane]} requests of this kind wait already: ask again in a little while")
            self._calls[lane] += 1
            if turn is not None:
                waiting = self._turns.get(turn)
                if waiting is not None:
                    waiting.append(asked)
                    return asked.answer
                self._turns[turn] = deque()
        self._start(asked)
        return asked.answer

    def is_free(self, lane: Lane) -> bool:
        """Whether a call would begin at once."""
        with self._lock:
            return self._calls[lane] < self._sizes[lane]

    def warm(self) -> None:
        """Have the processes that take in runs started and loaded; waits for nothing."""
        for _ in range(self._sizes[Lane.RUNS]):
            self.submit(Lane.RUNS, worker.load)

    def close(self) -> None:
        """End the lanes, once what runs has ended; what waits is dropped."""
        with self._lock:
            self._closed = True
            pools, self._pools = list(self._pools.values()), {}
        for pool in pools:
            pool.shutdown(wait=True, cancel_futures=True)

    def _start(self, asked: _Call) -> None:
        with self._lock:
            if not self._closed and asked.lane not in self._pools:
                self._pools[asked.lane] = self._make(asked.lane)
            pool = self._pools.get(asked.lane)
        if pool is None:
            self._ended(asked, BusyError("the service is ending"), None)
            return
        try:
            started = pool.submit(self._wrap, asked.function, asked.arguments)
        except RuntimeError as error:  # the pool is broken, or was closed meanwhile
            self._ended(asked, error, pool)
        else:
            started.add_done_callback(lambda done: self._ended(asked, done, pool))

    def _ended(self, asked: _Call, ended: "Future[Any] | Exception", pool: Executor | None) -> None:
        error = ended if isinstance(ended, Exception) else _error(ended)
        if isinstance(error, BrokenExecutor) and pool is not None:
            with self._lock:
                if self._pools.get(asked.lane) is pool:
                    del self._pools[asked.lane]
            pool.shutdown(wait=False)
            if not asked.retried:
                asked.retried = True
                self._start(asked)
                return
            error = BusyError("the process that worked on this has ended: ask again in a little while")
        following = None
        with self._lock:
            self._calls[asked.lane] -= 1
            if asked.turn is not None:
                waiting = self._turns[asked.turn]
                if waiting:
                    following = waiting.popleft()
                else:
                    del self._turns[asked.turn]
        if error is not None:
            asked.answer.set_exception(error)
        elif isinstance(ended, Future):
            asked.answer.set_result(ended.result())
        if following is not None:
            self._start(following)


def _error(ended: "Future[Any]") -> BaseException | None:
    return BusyError("the service is ending") if ended.cancelled() else ended.exception()


def in_processes(database: Database, processes: int) -> Workers:
    """Workers in processes of their own: `processes` that take in runs, one for files, one for answers."""
    context = multiprocessing.get_context("forkserver")  # loads the libraries once, for all that are forked off it
    context.set_forkserver_preload([worker.__name__, *worker.LOADED_EARLY])
    sizes = {Lane.RUNS: processes, Lane.FILES: 1, Lane.ANSWERS: 1}
    url = f"sqlite:///{database.path.absolute()}"

    def make(lane: Lane) -> Executor:
        return ProcessPoolExecutor(
            sizes[lane], mp_context=context, initializer=worker.begin, initargs=(url, lane.value)
        )

    return Workers(make, worker.call, sizes)


def in_threads(database: Database) -> Workers:
    """The same calls in threads of this process."""
    sizes = {Lane.RUNS: 2, Lane.FILES: 1, Lane.ANSWERS: 1}

    def make(lane: Lane) -> Executor:
        return ThreadPoolExecutor(sizes[lane], thread_name_prefix=lane.name.lower())

    def call(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        return function(database, *arguments)

    return Workers(make, call, sizes)
