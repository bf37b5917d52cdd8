"""A pure function of each of many inputs: what an executor does, what comes out, in this process or in a pool of processes.

Results and errors are values, equal whichever executor made them. Futures are made of so many inputs as workers need, and no
more: as one ends, the next input is taken. The processes of a pool have one thread for linear algebra each, and yield to all
other work.
"""

import multiprocessing
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Generic, Protocol, Self, TypeVar, cast

from service.work.background import end_with_parent, yield_to_others

Item = TypeVar("Item")
Result = TypeVar("Result")


class ExecutorUnavailableError(Exception):
    """The cluster cannot be used: its library is missing, it does not answer, or its workers have another release."""


class WorkerLostError(Exception):
    """The process that worked on an input has ended, at each repetition too."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome(Generic[Result]):
    """What came of the input number `index` (from 0): a result, or the error that the function raised."""

    index: int
    result: Result | None = None
    error: Exception | None = None

    def value(self) -> Result:
        """The result; raises the error where there is one."""
        if self.error is not None:
            raise self.error
        return cast("Result", self.result)  # which may be None


class Executor(Protocol):
    """Calls a function for each of many inputs. `close` it, or leave its `with` block, at the end."""

    @property
    def elsewhere(self) -> bool:
        """Whether other processes compute: then an input must hold all that the function needs, and be picklable."""

    def map(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool = True
    ) -> Iterator[Outcome[Result]]:
        """`function(item)` for each item; outcomes in the order of the items, or as they come.

        Items are taken from the iterable as they are needed: a few for each worker are in memory at once. An error of
        the function is an outcome, an error of the iterable is raised. Whoever stops iterating drops what waits.
        Raises ExecutorUnavailableError where the cluster cannot be used.
        """

    def close(self) -> None:
        """End all work at once, from any thread."""

    def __enter__(self) -> Self:
        """The executor itself."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""


class Closing:
    """The `with` block of an executor."""

    def close(self) -> None:
        """Nothing to end."""

    def __enter__(self) -> Self:
        """The executor itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""
        self.close()


def called(function: Callable[[Item], Result], item: Item) -> tuple[Result | None, Exception | None]:
    """The result of a function, or its error as it arrives from another process."""
    try:
        return function(item), None
    except Exception as error:  # noqa: BLE001  (an outcome, given to who asked)
        return None, _carried(error)


def _carried(error: Exception) -> Exception:
    """The error where it survives pickling, else one that says the same."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301  (its own bytes)
    except Exception:  # noqa: BLE001  (whatever an exception's own pickling raises)
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


class InProcess(Closing):
    """The executor `local`."""

    elsewhere = False

    def map(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        *,
        in_order: bool = True,  # noqa: ARG002  (as they come is in order)
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`; one item is in memory at a time."""
        for index, item in enumerate(items):
            result, error = called(function, item)
            yield Outcome(index=index, result=result, error=error)


#: How often the process of an input may end before that is taken for the input's doing. Chosen: as Dask's
#: `distributed.scheduler.allowed-failures`.
MAX_LOST = 3


class Submitter(Protocol):
    """What calls functions elsewhere."""

    def width(self) -> int:
        """How many inputs are to be on their way at once."""

    def submit(self, function: Callable[[Any], Any], item: Any) -> Any:
        """A future of `called(function, item)`."""

    def first(self, futures: Sequence[Any]) -> set[Any]:
        """Wait until at least one has ended; those that have."""

    def ended(self, future: Any) -> tuple[Any, Exception | None]:
        """What `called` returned; raises WorkerLostError where its process has ended."""


@dataclass(slots=True)
class _Task:
    """An input on its way, and how often its process has ended."""

    index: int
    item: Any
    lost: int = 0


def bounded(
    submitter: Submitter, function: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool
) -> Iterator[Outcome[Result]]:
    """As `Executor.map`.

    An input whose process has ended twice is sent alone: where others run in processes that end together, it is the one to
    blame if it ends so again.
    """
    numbered = iter(enumerate(items))
    running: dict[Any, _Task] = {}
    waiting: list[_Task] = []
    done: dict[int, Outcome[Result]] = {}
    following, exhausted = 0, False

    def take() -> _Task | None:
        nonlocal exhausted
        if waiting:
            return waiting.pop(0)
        following_input = None if exhausted else next(numbered, None)
        exhausted = following_input is None
        return None if following_input is None else _Task(*following_input)

    try:
        while True:
            alone = any(task.lost > 1 for task in (*waiting, *running.values()))
            width = 1 if alone else submitter.width()
            while len(running) + len(done) * in_order < width or not running:
                task = take()
                if task is None:
                    break
                running[submitter.submit(function, task.item)] = task
            if not running:
                return
            for future in submitter.first(list(running)):
                task = running.pop(future)
                try:
                    result, error = submitter.ended(future)
                except WorkerLostError as lost:
                    task.lost += 1
                    if task.lost < MAX_LOST:
                        waiting.append(task)
                        continue
                    result, error = None, lost
                done[task.index] = Outcome(index=task.index, result=result, error=error)
            ready = sorted(done) if not in_order else _run_of(done, following)
            for index in ready:
                yield done.pop(index)
            following += len(ready)
    finally:
        for future in running:
            future.cancel()


def _run_of(done: dict[int, Any], first: int) -> list[int]:
    """`first` and the indices that follow it without a gap."""
    ready = []
    while first in done:
        ready.append(first)
        first += 1
    return ready


#: Inputs on their way for each process. Chosen: one is computed, and one is there when that has ended.
INPUTS_AHEAD = 2


class Processes(Closing):
    """The executor `processes:N`. A process that ends is replaced, and what it did is done again."""

    elsewhere = True

    def __init__(self, count: int) -> None:
        self.count = count
        self._pool: _Pool | None = None
        self._closed = False
        self._lock = threading.Lock()

    def map(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool = True
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`."""
        return bounded(self, function, items, in_order=in_order)

    def close(self) -> None:
        """End the processes, whatever they do."""
        with self._lock:
            self._closed = True
            pool, self._pool = self._pool, None
        if pool is not None:
            pool.end()

    def width(self) -> int:
        """Two inputs for each process."""
        return INPUTS_AHEAD * self.count

    def submit(self, function: Callable[[Any], Any], item: Any) -> "Future[Any]":
        """A future of `called`; in a new pool where a process has ended."""
        with self._lock:
            if self._closed:
                raise RuntimeError("the executor is closed")
            if self._pool is None or self._pool.broken:
                self._pool = _Pool(self.count)
            try:
                return self._pool.submit(called, function, item)
            except BrokenExecutor:
                self._pool = _Pool(self.count)
                return self._pool.submit(called, function, item)

    def first(self, futures: Sequence["Future[Any]"]) -> set["Future[Any]"]:
        """Those that have ended, once one has."""
        return wait(futures, return_when=FIRST_COMPLETED).done

    def ended(self, future: "Future[Any]") -> tuple[Any, Exception | None]:
        """What `called` returned."""
        try:
            answer: tuple[Any, Exception | None] = future.result()
        except BrokenExecutor as error:
            raise WorkerLostError("the process that worked on this ended, and at each repetition again") from error
        except Exception as error:  # noqa: BLE001  (an input or a result that cannot be pickled)
            return None, error
        return answer


class _Pool(ProcessPoolExecutor):
    """Processes that end with this one, and leave an interrupt to it."""

    def __init__(self, count: int) -> None:
        super().__init__(count, mp_context=multiprocessing.get_context("forkserver"), initializer=_begin)

    @property
    def broken(self) -> bool:
        """Whether one of its processes has ended: it takes no calls any more."""
        return bool(self._broken)

    def end(self) -> None:
        """End the processes at once; by SIGKILL, for they are deaf to SIGTERM where a service's workers began what forks
        them."""
        for process in list((self._processes or {}).values()):
            process.kill()
        self.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    yield_to_others()
