"""What an executor does, and what comes out: results and errors as values, equal whichever executor made them."""

import pickle
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Generic, Protocol, Self, TypeVar, cast

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
