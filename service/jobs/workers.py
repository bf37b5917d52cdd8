"""The worker processes, which compute what would delay the process that answers requests.

A lane holds what may take equally long, so that a file of a million samples or an answer that takes seconds delays nothing
that is quick. Calls that change the same clutch take turns, since one would be computed in vain; so do a caller's answers,
since who asks for many would hold up all others.
Every call ends. One that waits for too long is refused as busy; one that takes longer than its lane allows is ended with its
process. A process says each second that it is there: one that has stopped is ended too, and what it did is done once more.
What starts processes is watched likewise, from a thread that waits for nothing.
The same calls can run in threads of the process itself (`in_threads`); both give the same.
"""

import math
import multiprocessing
import os
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from multiprocessing import forkserver, resource_tracker
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from opentelemetry import propagate

from service.errors import BusyError
from service.jobs import worker
from service.logging import LogFormat, LogLevel, request_id
from service.tracing import Carrier, tracer
from storage.engine.database import Database

if TYPE_CHECKING:
    from prometheus_client import Gauge

#: Calls of a lane that wait or run; more are refused as busy. Chosen: a minute of runs at 15 a second is 900. Of what takes
#: a second or more a call (files that are read, simulations) so few that the last one is answered within a minute.
_MAX_WAITING = 256
_MAX_WAITING_LONG = 32
#: Turns of which it is known which worker took the last call. Derived: more than a worker keeps filter states of.
_MAX_LAST = 1_000
#: [s] How long a call may wait to be begun, and how long a process may say nothing. Derived: both together and the start of
#: another process are less than the minute for which proxies and clients usually wait.
PATIENCE = 40.0
_SILENCE = 10.0
#: [s] How long a process may take to start before what starts it is taken for hung; where that loads libraries first.
#: Tried: 15 for both; on two processors that six others used loading took longer, and was begun again and again.
_START, _LOADING = 10.0, 60.0
#: [s] How long a change may take of which all that follows is computed again. Chosen: of 200 tests half a minute.
CHANGE_SECONDS = 600.0
#: [s] How long the calls that run have once the service ends. Chosen: with the 10 s before less than operators wait.
_LAST_SECONDS = 15.0
#: [s] Between two looks at all processes, and at an idle one.
_LOOK = 0.5
ENDING = "the service is shutting down: send the request again later"


class Lane(Enum):
    """The kinds of calls, each with its own queue and workers: runs to store, requested answers, simulations, long and
    raw records, uploaded files, and renewals of cached answers in the background.

    A lane's value is the niceness of its processes, None: they yield to all others; lanes that take the write lock
    yield little. Chosen by `make load`.
    """

    RUNS = 1
    ANSWERS = 2
    SIMULATIONS = 3
    RECORDS = 5
    FILES = 6
    RENEWALS = None


#: [s] How long a call of a lane may take. Chosen: ten times the longest of `make load` and docs/appendix/scale.md.
SECONDS = {
    Lane.RUNS: 60.0,
    Lane.ANSWERS: 120.0,
    Lane.SIMULATIONS: 60.0,
    Lane.RECORDS: 300.0,
    Lane.FILES: 600.0,
    Lane.RENEWALS: 1800.0,
}
#: Lanes of which each call takes long, and of which a single caller could have as many made as it likes.
_LONG = (Lane.SIMULATIONS, Lane.FILES)


#: Of each lane the gauge that shows how many of its calls wait or run; empty: none is shown.
Gauges = Mapping[Lane, "Gauge"]
NO_GAUGES: Gauges = MappingProxyType({})


@dataclass(slots=True, eq=False, kw_only=True)
class _Call:
    """A queued or running call, for the request with that id, below its tracing span `trace`; `retried`: its process
    once ended without an answer.

    `begun`: when a worker got it, None while it waits.
    """

    lane: Lane
    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    turn: str | None
    request: str
    trace: Carrier
    seconds: float
    patience: float
    queued_at: float = field(default_factory=time.monotonic)
    begun: float | None = None
    retried: bool = False
    answer: "Future[Any]" = field(default_factory=Future)

    @property
    def name(self) -> str:
        """The name of the function; for a partial, of the function within."""
        function = self.function
        while isinstance(function, partial):
            function = function.func
        return getattr(function, "__name__", type(function).__name__)

    def is_overdue(self, now: float) -> bool:
        """Whether the call is unanswered and has run for longer than allowed."""
        return self.begun is not None and now - self.begun > self.seconds and not self.answer.done()


class _LostError(Exception):
    """The worker process ended before it answered."""


class _Worker(ABC):
    """Makes the calls of a lane, one at a time. All methods but `check` and `stop` belong to the worker's own thread;
    `check` never waits. This base class has no process, so it needs no start, check or end."""

    #: Whether it has ended, or been ended, and is not there again.
    lost = False

    @abstractmethod
    def call(self, call: _Call) -> Any:
        """The result of the call's function; raises the function's error. Raises _LostError."""

    def look(self) -> bool:
        """Starts the process if needed; true if it runs."""
        return True

    def check(self, now: float) -> None:  # noqa: B027  (a thread cannot be ended)
        """Kill the process if it has not answered for too long."""

    def stop(self) -> None:  # noqa: B027  (as above: who asked has been answered)
        """Kill the process at once, even during a call."""

    def end(self) -> None:  # noqa: B027  (as above)
        """End the idle process in an orderly way."""


class Workers:
    """The queues and workers of all lanes. `submit` may be called from any thread; `close` at the end."""

    def __init__(self, make: Callable[[Lane], _Worker], sizes: dict[Lane, int], gauges: Gauges) -> None:
        """`make` creates a worker of a lane; `sizes`: the maximum number of workers by lane."""
        self._make = make
        self._gauges = gauges
        self._sizes = sizes
        self._lock = threading.Lock()
        self._asleep: dict[Lane, dict[_Worker, threading.Condition]] = {lane: {} for lane in Lane}
        self._last: dict[str, _Worker] = {}
        self._queues: dict[Lane, deque[_Call]] = {lane: deque() for lane in Lane}
        self._turns: dict[str, deque[_Call]] = {}
        self._calls = dict.fromkeys(Lane, 0)
        self._idle = dict.fromkeys(Lane, 0)
        self._threads: dict[Lane, list[threading.Thread]] = {lane: [] for lane in Lane}
        self._workers: dict[_Worker, tuple[Lane, _Call | None]] = {}
        self._closing = False
        self._closed = threading.Event()
        self._watching = threading.Thread(target=self._watch, name="workers", daemon=True)
        self._watching.start()

    def submit(
        self,
        lane: Lane,
        function: Callable[..., Any],
        *arguments: Any,
        turn: str | None = None,
        seconds: float | None = None,
        patience: float = PATIENCE,
    ) -> "Future[Any]":
        """Queue the call `function(database, *arguments)` and return its future; calls with the same `turn` run one
        after the other.

        Function, arguments and result must be picklable. The future gets a BusyError if the call waits for longer than
        `patience` [s] or runs for longer than `seconds` (default: of its lane). Raises BusyError if too many calls
        wait.
        """
        trace: dict[str, str] = {}
        propagate.inject(trace)
        call = _Call(
            lane=lane,
            function=function,
            arguments=arguments,
            turn=turn,
            request=request_id.get(),
            trace=trace,
            seconds=SECONDS[lane] if seconds is None else seconds,
            patience=math.inf if lane is Lane.RENEWALS else patience,
        )
        call.answer.set_running_or_notify_cancel()  # nobody who stops waiting stops what is stored
        with self._lock:
            most = _MAX_WAITING_LONG if lane in _LONG else _MAX_WAITING
            if self._closing or self._calls[lane] >= most:
                raise BusyError(f"{self._calls[lane]} requests of this kind already wait: try again later")
            self._count(lane, 1)
            if turn is not None and turn in self._turns:
                self._turns[turn].append(call)
            else:
                if turn is not None:
                    self._turns[turn] = deque()
                self._queue(call)
        return call.answer

    def are_idle(self) -> bool:
        """Whether no call waits or runs in any lane."""
        with self._lock:
            return not any(self._calls.values())

    def calls(self) -> dict[Lane, int]:
        with self._lock:
            return dict(self._calls)

    def ended(self) -> list[Lane]:
        """Lanes with a process that has ended or was killed and is not yet replaced."""
        with self._lock:
            lost = {lane for worker, (lane, _) in self._workers.items() if worker.lost}
        return [lane for lane in Lane if lane in lost]

    def oldest(self) -> tuple[Lane, float] | None:
        """The lane of the longest-running call and its duration [s]; None if no call runs."""
        with self._lock:
            running = [(call.begun, call.lane) for _, call in self._workers.values() if call and call.begun is not None]
        if not running:
            return None
        begun, lane = min(running, key=lambda item: item[0])
        return lane, time.monotonic() - begun

    def warm(self) -> None:
        """Start and load the processes of the lane of runs, without waiting for them."""
        for _ in range(self._sizes[Lane.RUNS]):
            self.submit(Lane.RUNS, worker.load, patience=math.inf)

    def close(self) -> None:
        """Refuse waiting calls, give running ones a limited time to end, then kill the remaining processes."""
        with self._lock:
            self._closing = True
            waiting = [call for queue in (*self._queues.values(), *self._turns.values()) for call in queue]
            for lane in Lane:
                while self._asleep[lane]:
                    self._wake(lane)
            threads = [thread for lane in Lane for thread in self._threads[lane]]
        for call in waiting:
            _answer(call, BusyError(ENDING))
        _join(threads, _LAST_SECONDS)
        with self._lock:
            left = list(self._workers)
        for open_worker in left:
            open_worker.stop()
        _join(threads, _SILENCE)
        self._closed.set()
        self._watching.join()

    def _queue(self, call: _Call) -> None:
        """Put the call into its lane's queue and wake or add a worker; the caller holds the lock."""
        lane = call.lane
        self._queues[lane].append(call)
        if self._idle[lane] < len(self._queues[lane]) and len(self._threads[lane]) < self._sizes[lane]:
            thread = threading.Thread(target=self._work, args=(lane,), name=f"{lane.name.lower()} calls", daemon=True)
            self._threads[lane].append(thread)
            thread.start()
        self._wake(lane, call.turn)

    def _wake(self, lane: Lane, turn: str | None = None) -> None:
        """Wake one of a lane's waiting workers: that of the last call with the same `turn`, for it has kept in memory what
        the next one needs, else any. The caller holds the lock."""
        asleep = self._asleep[lane]
        if asleep:
            last = self._last.get(turn or "")
            asleep.pop(last if last in asleep else next(reversed(asleep))).notify()

    def _work(self, lane: Lane) -> None:
        """The loop of a worker's own thread."""
        worker = self._make(lane)
        with self._lock:
            self._workers[worker] = (lane, None)
        while not self._closing:
            if not worker.look():
                self._closed.wait(_LOOK)
            elif (call := self._next(lane, worker)) is not None:
                self._do(call, worker)
        worker.end()
        with self._lock:
            del self._workers[worker]

    def _next(self, lane: Lane, worker: _Worker) -> _Call | None:
        """The lane's next call, marked as begun; None if none came for a while."""
        with self._lock:
            self._idle[lane] += 1
            if not self._queues[lane] and not self._closing:
                woken = self._asleep[lane][worker] = threading.Condition(self._lock)
                woken.wait(_LOOK)
                self._asleep[lane].pop(worker, None)
            self._idle[lane] -= 1
            if self._closing or not self._queues[lane]:
                return None
            call = self._queues[lane].popleft()
            call.begun = time.monotonic()
            self._workers[worker] = (lane, call)
            if call.turn is not None:
                self._last.pop(call.turn, None)
                self._last[call.turn] = worker
                if len(self._last) > _MAX_LAST:
                    del self._last[next(iter(self._last))]
            return call

    def _do(self, call: _Call, worker: _Worker) -> None:
        """Make a call and answer it; if its process ended, queue it once more."""
        error: BaseException | None = None
        result, retry = None, False
        try:
            result = worker.call(call)
        except _LostError:
            waited = time.monotonic() - call.queued_at
            retry = not (call.retried or call.answer.done() or waited > call.patience)
            error = BusyError("the process for this request ended unexpectedly: send the request again")
        except BaseException as raised:  # noqa: BLE001  (raised again for who asked)
            error = raised
        with self._lock:
            self._workers[worker] = (call.lane, None)
            if retry and not self._closing:
                call.retried, call.begun = True, None
                self._queues[call.lane].appendleft(call)
                self._wake(call.lane)
                return
            self._ended(call)
        _answer(call, error, result)

    def _count(self, lane: Lane, change: int) -> None:
        """Change a lane's count of waiting and running calls; the caller holds the lock."""
        self._calls[lane] += change
        if lane in self._gauges:
            self._gauges[lane].set(self._calls[lane])

    def _ended(self, call: _Call) -> None:
        """Queue the next call with the same `turn`; the caller holds the lock."""
        self._count(call.lane, -1)
        if call.turn is None:
            return
        waiting = self._turns[call.turn]
        if waiting:
            self._queue(waiting.popleft())
        else:
            del self._turns[call.turn]

    def _watch(self) -> None:
        """Check all processes and calls at intervals, without waiting for any of them."""
        looked = time.monotonic()
        while not self._closed.wait(_LOOK):
            now = time.monotonic()
            if now - looked < _SILENCE / 2:  # else this process itself stood still, and has heard nobody meanwhile
                self._refuse_late(now)
                self._stop_overdue(now)
            looked = now

    def _refuse_late(self, now: float) -> None:
        """Answer calls that waited longer than their patience with BusyError."""
        with self._lock:
            refused = [
                call for queue in self._queues.values() for call in queue if now - call.queued_at > call.patience
            ]
            for call in refused:
                self._queues[call.lane].remove(call)
                self._ended(call)
            for waiting in self._turns.values():
                late = [call for call in waiting if now - call.queued_at > call.patience]
                for call in late:
                    waiting.remove(call)
                    self._count(call.lane, -1)  # it held no turn, so nobody else's begins
                refused += late
        for call in refused:
            _answer(
                call,
                BusyError(f"the service is busy: the request waited {now - call.queued_at:.0f} s. Send it again later"),
            )

    def _stop_overdue(self, now: float) -> None:
        """Kill the processes that do not answer and those with an overdue call."""
        with self._lock:
            running = [(each, call) for each, (_, call) in self._workers.items()]
        for each, call in running:
            each.check(now)
            if call is not None and call.is_overdue(now):
                _answer(
                    call,
                    BusyError(
                        f"the computation took longer than {call.seconds:g} s and was stopped: ask again when the service "
                        "is less busy"
                    ),
                )
                each.stop()


def _answer(call: _Call, error: BaseException | None, result: Any = None) -> None:
    """Set the call's result or error, unless it has one already: a refused call may still come to its end."""
    with suppress(InvalidStateError):
        if error is None:
            call.answer.set_result(result)
        else:
            call.answer.set_exception(error)


def _join(threads: Iterable[threading.Thread], seconds: float) -> None:
    deadline = time.monotonic() + seconds
    for thread in threads:
        thread.join(max(0.0, deadline - time.monotonic()))


class _Here(_Worker):
    """A worker without a process: calls run in its own thread."""

    def __init__(self, database: Database) -> None:
        self._database = database

    def call(self, call: _Call) -> Any:
        request_id.set(call.request)
        with tracer.start_as_current_span(call.name, context=propagate.extract(call.trace)):
            return call.function(self._database, *call.arguments)


class _WorkerProcess(_Worker):
    """A worker with a process, started with `arguments` (the database, its niceness, its logging).

    Only `check` and `stop` are called from other threads; they end processes and wait for nothing.
    """

    def __init__(self, starter: "_Starter", arguments: tuple[Any, ...], *, silence: float) -> None:
        self.lost = False
        self._starter = starter
        self._arguments = arguments
        self._silence = silence
        self._process: Any = None
        self._line: Any = None
        self._heard = time.monotonic()
        self._starting: float | None = None

    def call(self, call: _Call) -> Any:
        try:
            self._line.send((call.name, call.function, call.arguments, call.request, call.trace))
            while not (message := self._receive()):
                pass
        except (EOFError, OSError) as error:
            self._lose()
            raise _LostError from error
        result, raised = message
        if raised is not None:
            raise raised
        return result

    def look(self) -> bool:
        try:
            if self._line is None:
                self._start()
            while self._line.poll():
                self._receive()
        except (EOFError, OSError):
            self._lose()
        return self._line is not None

    def check(self, now: float) -> None:
        starting = self._starting
        if starting is not None:
            self._starter.check(starting, now)
        elif self._line is not None and now - self._heard > self._silence:
            self.stop()

    def stop(self) -> None:
        self.lost = True
        if self._process is not None:
            _kill(self._process.pid)

    def end(self) -> None:
        if self._line is not None:
            self._line.close()
        if self._process is not None:
            self._starter.see_out(self._process)

    def _receive(self) -> Any:
        """The process's next message: an answer, an empty one once it is ready, or None as a sign of life."""
        message = self._line.recv()
        self._heard = time.monotonic()
        if message is not None:
            self.lost = False
        return message

    def _start(self) -> None:
        self._starting = time.monotonic()
        try:
            self._process, self._line = self._starter.start(self._arguments)
        finally:
            self._starting, self._heard = None, time.monotonic()

    def _lose(self) -> None:
        """Forget a process that ended, was killed or could not start; the next `look` starts another."""
        self.lost = True
        if self._line is not None:
            _kill(self._process.pid)
            self._line.close()
            self._line = None


class _Starter:
    """Starts worker processes from a fork server with the libraries loaded, and replaces a fork server that does not
    answer."""

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([worker.__name__, *worker.LOADED_EARLY])
        self._limit, self._moved = _LOADING, -math.inf  # when it was last seen to move, or begun
        self.begin()

    def begin(self) -> None:
        """Start the fork server with SIGTERM blocked, for it inherits this process's signal mask: if SIGTERM to a whole
        systemd unit ended it, all workers would be taken for dead. It ends when this process does."""
        resource_tracker.ensure_running()  # which would hear again what is blocked
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})

    def start(self, arguments: tuple[Any, ...]) -> tuple[Any, Any]:
        """Start a process; returns it and the connection to it. Raises EOFError or OSError if the fork server ended
        meanwhile."""
        self.begin()
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=worker.main, args=(theirs, *arguments))
        try:
            process.start()
        except BaseException:
            ours.close()
            raise
        finally:
            theirs.close()
        self._moved, self._limit = time.monotonic(), _START
        return process, ours

    def check(self, starting: float, now: float) -> None:
        """Kill the fork server if a process has been `starting` for too long."""
        if now - max(starting, self._moved) > self._limit:
            self._limit, self._moved = _LOADING, now
            self.stop()

    def stop(self) -> None:
        """Kill the fork server; the next start begins another."""
        pid = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]  # noqa: SLF001  (nothing else names it)
        if pid is not None:
            _kill(pid)

    def see_out(self, process: Any) -> None:
        """Wait for a process told to end, and kill it if it does not: this process waits at its exit for all its
        children."""
        process.join(_SILENCE)
        if process.is_alive():
            _kill(process.pid)
            process.join(1.0)
        if process.is_alive():  # it is not: what started it has not said so, and will not
            self.stop()
            process.join(1.0)


def _kill(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def in_processes(
    database: Database,
    processes: int,
    log: tuple[LogFormat, LogLevel] = ("auto", "warning"),
    gauges: Gauges = NO_GAUGES,
) -> Workers:
    """Workers in processes of their own, with this logging: `processes` for the lane of runs, one for each other lane."""
    starter = _Starter()

    def make(lane: Lane) -> _Worker:
        # what yields to all others may be left without a processor for long
        silence = 30 * _SILENCE if lane.value is None else _SILENCE
        return _WorkerProcess(starter, (database.url, lane.value, log), silence=silence)

    return Workers(make, dict.fromkeys(Lane, 1) | {Lane.RUNS: processes}, gauges)


def in_threads(database: Database, gauges: Gauges = NO_GAUGES) -> Workers:
    return Workers(lambda _: _Here(database), dict.fromkeys(Lane, 1) | {Lane.RUNS: 2}, gauges)
