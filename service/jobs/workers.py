"""Work outside the process that answers: calls of `function(database, ...)` in lanes of worker processes.

A lane holds what may take equally long, so that a file of a million samples or an answer that takes seconds delays nothing
that is quick. Calls that change the same clutch take turns, since one would be computed in vain; so do a caller's answers,
since who asks for many would hold up all others.
The same calls can run in threads of the process itself (`in_threads`); both give the same.
"""

import multiprocessing
import signal
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field
from enum import Enum
from multiprocessing import forkserver, resource_tracker
from typing import Any

from service.errors import BusyError
from service.jobs import worker
from service.logging import LogFormat, LogLevel, request_id
from storage.engine.database import Database

#: Calls of a lane that wait or run; more are refused as busy. Chosen: a minute of runs at 15 a second is 900. Of what takes
#: a second or more a call (files that are read, simulations) so few that the last one is answered within a minute.
_MOST_WAITING = 256
_MOST_WAITING_LONG = 32


class Lane(Enum):
    """What waits for what: runs that are taken in, answers that somebody waits for, simulations, long and raw records,
    files from outside, and answers that are made anew while the last ones are given.

    The values are by how much a lane's processes yield [nice], None to all others; what takes the write lock yields little.
    Chosen by `make load`.
    """

    RUNS = 1
    ANSWERS = 2
    SIMULATIONS = 3
    RECORDS = 5
    FILES = 6
    RENEWALS = None


#: Lanes of which each call takes long, and of which a single caller could have as many made as it likes.
_LONG = (Lane.SIMULATIONS, Lane.FILES)


@dataclass(slots=True)
class _Task:
    """A call on its way, made for the request with that id; `retried` once its process ended without an answer."""

    lane: Lane
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    turn: str | None
    request: str
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
        self._turns: dict[str, deque[_Task]] = {}
        self._restarts: dict[Lane, Future[Any]] = {}
        self._lost: set[Lane] = set()  # whose processes ended at a call and again at its repetition
        self._lock = threading.Lock()
        self._closed = False

    def submit(
        self, lane: Lane, function: Callable[..., Any], *arguments: Any, turn: str | None = None
    ) -> "Future[Any]":
        """Have `function(database, *arguments)` called; calls of the same `turn` run one after the other.

        Function, arguments and result must be picklable. Raises BusyError where too many wait.
        """
        task = _Task(lane, function, arguments, turn, request_id.get())
        task.answer.set_running_or_notify_cancel()  # nobody who stops waiting stops what is stored
        with self._lock:
            most = _MOST_WAITING_LONG if lane in _LONG else _MOST_WAITING
            if self._closed or self._calls[lane] >= most:
                raise BusyError(f"{self._calls[lane]} requests of this kind wait already: ask again in a little while")
            self._calls[lane] += 1
            if turn is not None:
                waiting = self._turns.get(turn)
                if waiting is not None:
                    waiting.append(task)
                    return task.answer
                self._turns[turn] = deque()
        self._start(task)
        return task.answer

    def are_idle(self) -> bool:
        """Whether no call waits or runs in any lane."""
        with self._lock:
            return not any(self._calls.values())

    def calls(self) -> dict[Lane, int]:
        """Calls that wait or run, by lane."""
        with self._lock:
            return dict(self._calls)

    def ended(self) -> list[Lane]:
        """Lanes of which a process has ended while it had nothing to do, or twice at one call, and whose next ones are not
        up yet: asking starts them. One that ends at work once is replaced with its call. One thread may ask at a time."""
        with self._lock:
            broken = [lane for lane, pool in self._pools.items() if isinstance(pool, _Processes) and pool.broken]
            for lane in broken:
                del self._pools[lane]
            lost = {lane for lane in self._lost if lane not in self._restarts}
        failed = [lane for lane, restart in self._restarts.items() if restart.done() and restart.exception()]
        for lane in {*broken, *failed, *lost}:
            self._restarts[lane] = self.submit(lane, worker.load)
        self._restarts = {
            lane: restart for lane, restart in self._restarts.items() if not restart.done() or restart.exception()
        }
        with self._lock:
            return [lane for lane in Lane if lane in self._restarts or lane in self._lost]

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

    def _start(self, task: _Task) -> None:
        with self._lock:
            if not self._closed and task.lane not in self._pools:
                self._pools[task.lane] = self._make(task.lane)
            pool = self._pools.get(task.lane)
        if pool is None:
            self._ended(task, BusyError("the service is ending"), None)
            return
        try:
            started = pool.submit(self._wrap, task.function, task.arguments, task.request)
        except RuntimeError as error:  # the pool is broken, or was closed meanwhile
            self._ended(task, error, pool)
        else:
            started.add_done_callback(lambda done: self._ended(task, done, pool))

    def _ended(self, task: _Task, ended: "Future[Any] | Exception", pool: Executor | None) -> None:
        error = ended if isinstance(ended, Exception) else _error(ended)
        if isinstance(error, BrokenExecutor) and pool is not None:
            with self._lock:
                if self._pools.get(task.lane) is pool:
                    del self._pools[task.lane]
            # the pool ends by itself, and holds its lock while it says so
            if not task.retried:
                task.retried = True
                self._start(task)
                return
            with self._lock:
                self._lost.add(task.lane)
            error = BusyError("the process that worked on this has ended: ask again in a little while")
        following = None
        with self._lock:
            self._calls[task.lane] -= 1
            if error is None:
                self._lost.discard(task.lane)
            if task.turn is not None:
                waiting = self._turns[task.turn]
                if waiting:
                    following = waiting.popleft()
                else:
                    del self._turns[task.turn]
        if error is not None:
            task.answer.set_exception(error)
        elif isinstance(ended, Future):
            task.answer.set_result(ended.result())
        if following is not None:
            self._start(following)


def _error(ended: "Future[Any]") -> BaseException | None:
    return BusyError("the service is ending") if ended.cancelled() else ended.exception()


class _Processes(ProcessPoolExecutor):
    """The processes of a lane."""

    @property
    def broken(self) -> bool:
        """Whether one of them has ended: then the others do too, and none takes calls any more."""
        return bool(self._broken)


def in_processes(database: Database, processes: int, log: tuple[LogFormat, LogLevel] = ("auto", "warning")) -> Workers:
    """Workers in processes of their own, which log so: `processes` that take in runs, one for each other lane."""
    context = multiprocessing.get_context("forkserver")  # loads the libraries once, for all that are forked off it
    context.set_forkserver_preload([worker.__name__, *worker.LOADED_EARLY])
    _start_forkserver()
    sizes = dict.fromkeys(Lane, 1) | {Lane.RUNS: processes}

    def make(lane: Lane) -> Executor:
        arguments = (database.url, lane.value, log)
        return _Processes(sizes[lane], mp_context=context, initializer=worker.begin, initargs=arguments)

    return Workers(make, worker.call, sizes)


def _start_forkserver() -> None:
    """Start what the workers are forked off, deaf to SIGTERM as it is while this process is: with it all workers would be
    taken for dead where a whole unit is stopped. It ends when this process does."""
    resource_tracker.ensure_running()  # which would hear again what is blocked
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})


def in_threads(database: Database) -> Workers:
    """The same calls in threads of this process."""
    sizes = dict.fromkeys(Lane, 1) | {Lane.RUNS: 2}

    def make(lane: Lane) -> Executor:
        return ThreadPoolExecutor(sizes[lane], thread_name_prefix=lane.name.lower())

    def call(function: Callable[..., Any], arguments: tuple[Any, ...], request: str) -> Any:
        request_id.set(request)
        return function(database, *arguments)

    return Workers(make, call, sizes)
