"""A pool of processes on this machine, each with one thread for linear algebra, that yield to all other work."""

import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from typing import Any

from service.background import end_with_parent, yield_to_others
from service.executors.bounded import bounded
from service.executors.executor import Closing, Item, Outcome, Result, WorkerLostError, called

#: Inputs on their way for each process. Chosen: one is computed, and one is there when that has ended.
_INPUTS_AHEAD = 2


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
        return _INPUTS_AHEAD * self.count

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
