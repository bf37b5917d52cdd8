"""Work that waits for all other: diagnoses, answers made anew, clutches tracked anew under another fleet prior, replays.

python -m service.background MODULE ...    runs a module so, what it imports and all
"""

import os
import runpy
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Protocol, TypeVar

from threadpoolctl import threadpool_limits

Result = TypeVar("Result")


class AtOnce(Protocol):
    """How work in the background has something done that others wait for, as they do for who holds the write lock."""

    def __call__(self, function: Callable[..., Result], /, *arguments: Any) -> Result:
        """What `function(*arguments)` returns or raises."""


def directly(function: Callable[..., Result], /, *arguments: Any) -> Result:
    """`AtOnce` for work that does not yield."""
    return function(*arguments)


def yield_to_others() -> None:
    """Have the calling thread, or process before it starts threads, run where the processors have nothing else to do.

    On Linux by the policy SCHED_IDLE: what wakes takes such a processor as idle, and need not wait for the next balancing
    as it does beside a thread of the lowest priority (`nice` 19), which is what other systems give. The threads in which
    libraries of linear algebra help do not yield: in this process they no longer do.
    """
    threadpool_limits(limits=1, user_api="blas")
    if hasattr(os, "SCHED_IDLE"):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    else:
        os.nice(19)


def in_background(work: Callable[[AtOnce], Result]) -> Result:
    """What `work` returns, done in a thread that yields but for what it has done at once."""
    with ThreadPoolExecutor(1) as usual, ThreadPoolExecutor(1, initializer=yield_to_others) as background:
        usual.submit(directly, bool).result()  # a thread has the priority of the one that begins it

        def at_once(function: Callable[..., Any], /, *arguments: Any) -> Any:
            return usual.submit(function, *arguments).result()

        return background.submit(work, at_once).result()


if __name__ == "__main__":
    yield_to_others()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
