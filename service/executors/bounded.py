"""Futures of so many inputs as workers need, and no more: as one ends, the next input is taken."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from service.executors.executor import Item, Outcome, Result, WorkerLostError

#: How often the process of an input may end before that is taken for the input's doing. Chosen: as Dask's
#: `distributed.scheduler.allowed-failures`.
MOST_LOST = 3


class Future(Protocol):
    """What `concurrent.futures` and Dask both give."""

    def cancel(self) -> Any:
        """Drop it where it waits."""


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
                    if task.lost < MOST_LOST:
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
