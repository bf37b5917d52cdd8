"""A pure function of each of many inputs: what an executor does, what comes out, in this process, in a pool of processes, or
on a Dask cluster, reached by its scheduler's address, whose workers need this program and no database.

Results and errors are values, equal whichever executor made them. Futures are made of so many inputs as workers need, and no
more: as one ends, the next input is taken. The processes of a pool have one thread for linear algebra each, and yield to all
other work. `in_rounds` loads, computes and stores each of many names; one that no longer holds is taken up once more.
Source: https://distributed.dask.org/en/stable/api.html (Client, wait), .../resilience.html (tasks of workers that end).
"""

import multiprocessing
import os
import pickle
import platform
import signal
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import cache
from importlib.metadata import version
from itertools import count
from queue import SimpleQueue
from typing import Any, Generic, Self, TypeVar, cast

from service.defaults import SCHEDULERS
from service.jobs.background import end_with_parent, use_one_blas_thread, yield_to_others

Item = TypeVar("Item")
Result = TypeVar("Result")


class ExecutorUnavailableError(Exception):
    """The cluster cannot be used: its library is missing, it does not answer, or its workers have another release."""


class WorkerLostError(Exception):
    """The process working on an input has ended, at each repetition too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome(Generic[Result]):
    """The outcome of input number `index` (from 0): a result, or the error that the function raised."""

    index: int
    result: Result | None = None
    error: Exception | None = None

    def value(self) -> Result:
        """The result; raises the error where there is one."""
        if self.error is not None:
            raise self.error
        return cast("Result", self.result)  # which may be None


class Executor(ABC):
    """Calls a function for each of many inputs. `close` it, or leave its `with` block, at the end."""

    #: Whether other processes compute: then an input must hold all that the function needs, and be picklable.
    elsewhere: bool

    @abstractmethod
    def map(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool = True
    ) -> Iterator[Outcome[Result]]:
        """Compute `function(item)` for each item; yields outcomes in the order of the items, or as they come.

        Items are taken from the iterable as they are needed: a few per worker are in memory at once. An error of the
        function is an outcome, an error of the iterable is raised. If the caller stops iterating, waiting items are
        dropped. Raises ExecutorUnavailableError if the cluster cannot be used.
        """

    def close(self) -> None:  # noqa: B027  (this process has nothing to end)
        """Stop all work at once; may be called from any thread."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        self.close()


def called(function: Callable[[Item], Result], item: Item) -> tuple[Result | None, Exception | None]:
    """A function's result, or its error in a form that can be sent to another process."""
    try:
        return function(item), None
    except Exception as error:  # noqa: BLE001  (an outcome, given to who asked)
        return None, _carried(error)


def _carried(error: Exception) -> Exception:
    """The error if it can be pickled, else a picklable one with the same message."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  (its own bytes)
    except Exception:  # noqa: BLE001  (whatever an exception's own pickling raises)
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


class InProcess(Executor):
    """The executor `local`: computes in a thread of this process that yields to all others.

    The calling thread loads and stores, because others may wait for its locks. An interrupt (Ctrl-C) ends it without
    waiting for the computation, which ends with the process.
    """

    elsewhere = False

    def map(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        *,
        in_order: bool = True,  # noqa: ARG002  (as they come is in order)
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`; one item is in memory at a time."""
        inputs: SimpleQueue[tuple[Item] | None] = SimpleQueue()
        called_ones: SimpleQueue[tuple[Result | None, Exception | None] | BaseException] = SimpleQueue()

        def compute() -> None:
            try:
                yield_to_others()
                while (given := inputs.get()) is not None:
                    called_ones.put(called(function, *given))
            except BaseException as error:  # noqa: BLE001  (raised again by who asked)
                called_ones.put(error)

        threading.Thread(target=compute, name="background", daemon=True).start()
        try:
            for index, item in enumerate(items):
                inputs.put((item,))
                answer = called_ones.get()
                if isinstance(answer, BaseException):
                    raise answer
                yield Outcome(index=index, result=answer[0], error=answer[1])
        finally:
            inputs.put(None)


#: How often the process of an input may end before that is taken for the input's doing. Chosen: as Dask's
#: `distributed.scheduler.allowed-failures`.
MAX_LOST = 3


@dataclass(slots=True)
class _Task:
    """An input being computed, and how often its process has ended."""

    index: int
    item: Any
    lost: int = 0


class _RemoteExecutor(Executor):
    """An executor that sends inputs to other processes one by one."""

    elsewhere = True
    #: What a future raises whose process has ended, and what is said of it then.
    lost: tuple[type[Exception], str]

    @abstractmethod
    def width(self) -> int:
        """The maximum number of inputs sent and not yet answered."""

    @abstractmethod
    def submit(self, function: Callable[[Any], Any], item: Any) -> "Future[Any]":
        """Send the call `called(function, item)` to a process; returns its future."""

    def require_any_worker(self) -> None:
        """Raise ExecutorUnavailableError if no worker is left."""

    def map(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool = True
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`.

        An input whose process has ended twice is sent alone: where others run in processes that end together, it is the
        one to blame if it ends so again.
        """
        inputs = (_Task(index, item) for index, item in enumerate(items))
        running: dict[Future[Any], _Task] = {}
        waiting: list[_Task] = []
        done: dict[int, Outcome[Result]] = {}
        following = 0
        try:
            while True:
                alone = any(task.lost > 1 for task in (*waiting, *running.values()))
                width = 1 if alone else self.width()
                while len(running) + len(done) * in_order < width or not running:
                    task = waiting.pop(0) if waiting else next(inputs, None)
                    if task is None:
                        break
                    running[self.submit(function, task.item)] = task
                if not running:
                    return
                for future in self._first(running):
                    task = running.pop(future)
                    result, error = self._outcome(future)
                    if isinstance(error, WorkerLostError):
                        task.lost += 1
                        if task.lost < MAX_LOST:
                            waiting.append(task)
                            continue
                    done[task.index] = Outcome(index=task.index, result=result, error=error)
                for index in sorted(done):
                    if in_order and index != following:
                        break
                    following += 1
                    yield done.pop(index)
        finally:
            for future in running:
                future.cancel()

    def _first(self, futures: Iterable["Future[Any]"]) -> set["Future[Any]"]:
        """Wait until a future has ended; returns all that have."""
        while not (ended := wait(futures, _COUNT_SECONDS, FIRST_COMPLETED).done):
            self.require_any_worker()
        return ended

    def _outcome(self, future: "Future[Any]") -> tuple[Any, Exception | None]:
        """A finished call's result, or its error; a WorkerLostError if the process ended before it answered.

        Raises ExecutorUnavailableError where a worker is of another release.
        """
        lost, message = self.lost
        try:
            answer: tuple[Any, Exception | None] = future.result()
        except lost as error:
            return None, WorkerLostError(message.format(error))
        except ExecutorUnavailableError:
            raise
        except Exception as error:  # noqa: BLE001  (an input or a result that cannot be pickled)
            return None, error
        return answer


#: [s] How old the count of a cluster's threads may be, and between two looks whether any is left. Chosen: a cluster grows
#: within minutes.
_COUNT_SECONDS = 5.0
#: Inputs on their way for each process or thread. Chosen: one is computed, and one is there when that has ended.
INPUTS_AHEAD = 2


class Processes(_RemoteExecutor):
    """The executor `processes:N`. A process that ends is replaced, and its work is repeated."""

    lost = BrokenExecutor, "the process that computed this ended at each attempt"

    def __init__(self, processes: int) -> None:
        self.processes = processes
        self._pool: _Pool | None = None
        self._closed = False
        self._lock = threading.Lock()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            pool, self._pool = self._pool, None
        if pool is not None:
            pool.end()

    def width(self) -> int:
        return INPUTS_AHEAD * self.processes

    def submit(self, function: Callable[[Any], Any], item: Any) -> "Future[Any]":
        """Send the call to the pool; a pool with an ended process is replaced."""
        with self._lock:
            if self._closed:
                raise RuntimeError("the executor is closed")
            if self._pool is not None:
                with suppress(BrokenExecutor):  # one of its processes has ended: it takes no calls any more
                    return self._pool.submit(called, function, item)
            self._pool = _Pool(self.processes)
            return self._pool.submit(called, function, item)


class _Pool(ProcessPoolExecutor):
    """A process pool whose processes end with this one and leave Ctrl-C to it."""

    def __init__(self, processes: int) -> None:
        super().__init__(processes, mp_context=multiprocessing.get_context("forkserver"), initializer=_begin)

    def end(self) -> None:
        """Kill the pool's processes at once, by SIGKILL: those forked below a service's workers have SIGTERM blocked."""
        for process in list((self._processes or {}).values()):
            process.kill()
        self.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """Prepare a process of the pool."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    yield_to_others()


#: [s] How long a scheduler may take to answer, and one without workers to get one. Chosen; no table.
CONNECT_SECONDS, WORKER_SECONDS = 10.0, 60.0
#: What must be the same on both sides, for the same results to the last bit.
_OF_RESULTS = ("clutchlife", "numpy", "scipy")


@cache
def release() -> dict[str, str]:
    """The versions that results depend on (code, Python, numerical libraries), by name."""
    return {"python": platform.python_version()} | {name: version(name) for name in _OF_RESULTS}


class Cluster(_RemoteExecutor):
    """The executor for the address of a Dask scheduler. If a worker ends, another repeats its work."""

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, KilledWorker  # optional, and start-up time
        except ModuleNotFoundError as error:
            raise ExecutorUnavailableError(
                f"{address}: a Dask cluster needs its library: pip install -e '.[cluster]' in a checkout"
            ) from error
        self.address = address
        try:  # its library has no types
            self._client: Any = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, TimeoutError, ValueError) as error:
            raise ExecutorUnavailableError(f"{address}: no Dask scheduler answers there ({error})") from error
        self._futures: Any = self._client.get_executor(pure=False)  # type: ignore[no-untyped-call]
        self.lost = KilledWorker, "the processes that computed this have ended ({})"
        self._counted = -_COUNT_SECONDS
        self._threads, self._last_seen = 0, time.monotonic()
        try:
            self._require_workers()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._client.close()

    def width(self) -> int:
        self._count()
        return INPUTS_AHEAD * max(1, self._threads)

    def submit(self, function: Callable[[Any], Any], item: Any) -> "Future[Any]":
        import dask.config  # optional, and start-up time

        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"}):
            future: Future[Any] = self._futures.submit(_called, release(), function, item)
        return future

    def _outcome(self, future: "Future[Any]") -> tuple[Any, Exception | None]:
        if future.cancelled():
            raise ExecutorUnavailableError(f"{self.address}: the Dask scheduler has ended")
        return super()._outcome(future)

    def _count(self) -> None:
        """Update the number of the cluster's threads, if the last count is old."""
        now = time.monotonic()
        if now - self._counted > _COUNT_SECONDS:
            self._threads = sum(self._client.nthreads().values())
            self._counted = now
            self._last_seen = now if self._threads else self._last_seen

    def require_any_worker(self) -> None:
        self._count()
        if self._counted - self._last_seen > WORKER_SECONDS:
            raise ExecutorUnavailableError(f"{self.address}: the Dask scheduler has no worker any more")

    def _require_workers(self) -> None:
        """Wait for a first worker, and raise ExecutorUnavailableError if none comes or one has another release."""
        try:
            self._client.wait_for_workers(1, timeout=WORKER_SECONDS)
        except TimeoutError as error:
            start = f"dask worker {self.address} --nthreads 1"
            raise ExecutorUnavailableError(f"{self.address}: the Dask scheduler has no worker: {start}") from error
        try:
            differences: Mapping[str, str | None] = self._client.run(_difference, release())
        except Exception as error:  # a worker without this program cannot read the question
            raise ExecutorUnavailableError(
                f"{self.address}: a worker cannot import clutchlife ({error}): install this release there"
            ) from error
        for worker, difference in differences.items():
            if difference is not None:
                raise ExecutorUnavailableError(f"worker {worker}: {difference}")


def _difference(wanted: Mapping[str, str]) -> str | None:
    """A sentence on how this process's versions differ from the wanted ones; None if they agree."""
    own = release()
    differing = [
        f"{name} {own.get(name)} instead of {wanted[name]}" for name in wanted if own.get(name) != wanted[name]
    ]
    return f"it has {', '.join(differing)}: results could differ" if differing else None


def _called(wanted: Mapping[str, str], function: Callable[[Any], Any], item: Any) -> tuple[Any, Exception | None]:
    """`called`, after a check that this worker has the wanted release: workers may join at any time."""
    difference = _difference(wanted)
    if difference is not None:
        raise ExecutorUnavailableError(f"a worker of the cluster: {difference}")
    _prepare()
    return called(function, item)


_prepare = cache(use_one_blas_thread)


def executor_of(scheduler: str) -> Executor:
    """The executor for a setting: `local`: a thread of this process that yields; `processes[:N]`: a pool of N processes
    (default: one per core); `tcp://host:port`: a Dask cluster.

    Raises ValueError on anything else, ExecutorUnavailableError where the cluster cannot be used.
    """
    if scheduler == "local":
        return InProcess()
    if scheduler == "processes":
        return Processes(os.cpu_count() or 1)
    if scheduler.startswith(("tcp://", "tls://")):
        return Cluster(scheduler)
    kind, _, number = scheduler.partition(":")
    if kind == "processes" and number.isdecimal() and int(number) > 0:
        return Processes(int(number))
    raise ValueError(f"the scheduler must be {SCHEDULERS}, got {scheduler!r}")


class Ending(Enum):
    """How the work on a name ended."""

    STORED = "its result is stored"
    NOTHING = "there was nothing to compute"
    FAILED = "loading or computing raised an error"
    LEFT = "its input changed during each attempt"


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended(Generic[Result]):
    """How the work on a name ended, with its result if that was stored and its error if there was one."""

    name: str
    ending: Ending
    result: Result | None = None
    error: Exception | None = None


def in_rounds(
    executor: Executor,
    names: Sequence[str],
    *,
    load: Callable[[str], Item | None],
    compute: Callable[[Item], Result],
    store: Callable[[Item, Result], bool],
    rounds: int,
) -> Iterator[Ended[Result]]:
    """Load, compute and store each name; yields each name as it ends. `load` returns None if there is nothing to do.
    `store` returns false if the item is out of date; the name is then repeated, in at most `rounds` rounds."""
    for left in reversed(range(rounds)):
        to_repeat = []
        for ended in _round(executor, names, load, compute, store):
            if ended.ending is Ending.LEFT and left:
                to_repeat.append(ended.name)
            else:
                yield ended
        names = to_repeat


def _round(
    executor: Executor,
    names: Sequence[str],
    load: Callable[[str], Item | None],
    compute: Callable[[Item], Result],
    store: Callable[[Item, Result], bool],
) -> Iterator[Ended[Result]]:
    """One round of `in_rounds`: each name is loaded, computed and stored once."""
    numbers, sent = count(), dict[int, tuple[str, Item]]()
    not_sent: list[Ended[Result]] = []

    def items() -> Iterator[Item]:
        """The inputs as they are loaded; names without one are noted in `not_sent`."""
        for name in names:
            try:
                item = load(name)
            except Exception as error:  # noqa: BLE001  (given to who asked)
                not_sent.append(Ended(name=name, ending=Ending.FAILED, error=error))
                continue
            if item is None:
                not_sent.append(Ended(name=name, ending=Ending.NOTHING))
                continue
            sent[next(numbers)] = name, item
            yield item

    for outcome in executor.map(compute, items(), in_order=False):
        name, item = sent.pop(outcome.index)
        yield from not_sent
        not_sent.clear()
        if outcome.error is not None:
            yield Ended(name=name, ending=Ending.FAILED, error=outcome.error)
        elif store(item, outcome.value()):
            yield Ended(name=name, ending=Ending.STORED, result=outcome.value())
        else:
            yield Ended(name=name, ending=Ending.LEFT)
    yield from not_sent
