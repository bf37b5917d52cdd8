"""A Dask cluster, reached by its scheduler's address, and the one option by which an executor is chosen.

The cluster's workers need this program and no database.
Source: https://distributed.dask.org/en/stable/api.html (Client, wait), .../resilience.html (tasks of workers that end).
"""

import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from typing import Any

from service.defaults import SCHEDULERS
from service.work.background import use_one_blas_thread
from service.work.executor import (
    Closing,
    Executor,
    ExecutorUnavailableError,
    InProcess,
    Item,
    Outcome,
    Processes,
    Result,
    WorkerLostError,
    bounded,
    called,
)

#: [s] How long a scheduler may take to answer, and one without workers to get one. Chosen; no table.
CONNECT_SECONDS, WORKER_SECONDS = 10.0, 60.0
#: [s] How old the count of the cluster's threads may be. Chosen: a cluster grows within minutes.
_COUNT_SECONDS = 5.0
#: [s] Between two looks for what has ended. Chosen: little beside an input that takes a second.
_LOOK_SECONDS = 0.02
#: Inputs on their way for each thread of a worker. Chosen: one is computed, and one is there when that has ended.
_INPUTS_AHEAD = 2
#: What must be the same on both sides, for the same results to the last bit.
_OF_RESULTS = ("clutchlife", "numpy", "scipy")


@cache
def release() -> dict[str, str]:
    """The versions that decide on results, by name."""
    return {"python": platform.python_version()} | {name: version(name) for name in _OF_RESULTS}


class Cluster(Closing):
    """The executor of a scheduler's address. What a worker did that has ended is done again by another."""

    elsewhere = True

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client, as_completed  # optional, and start-up time
        except ModuleNotFoundError as error:
            raise ExecutorUnavailableError(
                f"{address}: a Dask cluster needs its library: pip install -e '.[cluster]' in a checkout"
            ) from error
        self.address = address
        self._client: Any  # its library has no types
        try:
            self._client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, TimeoutError, ValueError) as error:
            raise ExecutorUnavailableError(f"{address}: no Dask scheduler answers there ({error})") from error
        self._completed: Any = as_completed(loop=self._client.loop)  # type: ignore[no-untyped-call]
        self._counted = -_COUNT_SECONDS
        self._threads, self._last_seen = 0, time.monotonic()
        try:
            self._require_workers()
        except BaseException:
            self.close()
            raise

    def map(
        self, function: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool = True
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`."""
        return bounded(self, function, items, in_order=in_order)

    def close(self) -> None:
        """Drop what waits, and leave the cluster."""
        self._client.close()

    def width(self) -> int:
        """Two inputs for each thread that the cluster has."""
        self._count()
        return _INPUTS_AHEAD * max(1, self._threads)

    def submit(self, function: Callable[[Any], Any], item: Any) -> Any:
        """A future of `called` on a worker, which refuses it where it has another release."""
        import dask.config  # optional, and start-up time

        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TB"}):
            future = self._client.submit(_called, release(), function, item, pure=False)
        self._completed.add(future)
        return future

    def first(self, futures: Sequence[Any]) -> set[Any]:
        """One that has ended, once one has. Raises ExecutorUnavailableError where the last worker has ended."""
        while True:
            while not self._completed.has_ready():
                self._require_any_worker()
                time.sleep(_LOOK_SECONDS)
            future = next(self._completed)
            if future in futures:  # another was dropped by who stopped iterating
                return {future}

    def ended(self, future: Any) -> tuple[Any, Exception | None]:
        """What `called` returned; raises ExecutorUnavailableError where the scheduler has ended or has no worker any more,
        or as `_called` does. What ended with a worker before it was read is computed again by another."""
        from distributed import KilledWorker  # optional, and start-up time

        while True:
            if future.cancelled():
                raise ExecutorUnavailableError(f"{self.address}: the Dask scheduler has ended")
            try:
                answer: tuple[Any, Exception | None] = future.result(timeout=CONNECT_SECONDS)
            except TimeoutError:  # it is no error of the function's: those are returned
                self._require_any_worker()
            except KilledWorker as error:
                raise WorkerLostError(f"the processes that worked on this have ended ({error})") from error
            except ExecutorUnavailableError:
                raise
            except Exception as error:  # noqa: BLE001  (an input or a result that cannot be pickled)
                return None, error
            else:
                return answer

    def _count(self) -> None:
        """See how many threads there are, now and then."""
        now = time.monotonic()
        if now - self._counted > _COUNT_SECONDS:
            self._threads = sum(self._client.nthreads().values())
            self._counted = now
            self._last_seen = now if self._threads else self._last_seen

    def _require_any_worker(self) -> None:
        self._count()
        if self._counted - self._last_seen > WORKER_SECONDS:
            raise ExecutorUnavailableError(f"{self.address}: the Dask scheduler has no worker any more")

    def _require_workers(self) -> None:
        """At least one worker, and none of another release."""
        try:
            self._client.wait_for_workers(1, timeout=WORKER_SECONDS)
        except TimeoutError as error:
            raise ExecutorUnavailableError(
                f"{self.address}: the Dask scheduler has no worker: dask worker {self.address} --nthreads 1"
            ) from error
        try:
            others: Mapping[str, str | None] = self._client.run(_difference, release())
        except Exception as error:  # a worker without this program cannot read the question
            raise ExecutorUnavailableError(f"{self.address}: a worker lacks clutchlife ({error})") from error
        for worker, difference in others.items():
            if difference is not None:
                raise ExecutorUnavailableError(f"worker {worker}: {difference}")


def _difference(wanted: Mapping[str, str]) -> str | None:
    """How this process's release differs from what is wanted, in words; None where it does not."""
    own = release()
    differing = [
        f"{name} {own.get(name)} instead of {wanted[name]}" for name in wanted if own.get(name) != wanted[name]
    ]
    return f"it has {', '.join(differing)}: results could differ" if differing else None


def _called(wanted: Mapping[str, str], function: Callable[[Any], Any], item: Any) -> tuple[Any, Exception | None]:
    """`called`, in a worker of the same release: workers may join at any time."""
    difference = _difference(wanted)
    if difference is not None:
        raise ExecutorUnavailableError(f"a worker of the cluster: {difference}")
    _prepare()
    return called(function, item)


@cache
def _prepare() -> None:
    use_one_blas_thread()


LOCAL, _POOL, _CLUSTER = "local", "processes", ("tcp://", "tls://")


def executor_of(scheduler: str) -> Executor:
    """`local`: this process; `processes[:N]`: a pool of N, or of a process a core; `tcp://host:port`: a Dask cluster.

    Raises ValueError on anything else, ExecutorUnavailableError where the cluster cannot be used.
    """
    if scheduler == LOCAL:
        return InProcess()
    if scheduler.startswith(_CLUSTER):
        return Cluster(scheduler)
    kind, colon, count = scheduler.partition(":")
    if kind == _POOL and not colon:
        return Processes(os.cpu_count() or 1)
    if kind == _POOL and count.isdecimal() and int(count) > 0:
        return Processes(int(count))
    raise ValueError(f"the scheduler must be {SCHEDULERS}, got {scheduler!r}")
