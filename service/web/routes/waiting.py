"""A request waits for the end of what it asked for, whichever service does it."""

import asyncio
import time
from collections.abc import Callable
from typing import TypeVar

from fastapi.concurrency import run_in_threadpool

State = TypeVar("State")
#: [s] Between two looks whether a job has ended: first, by how much longer each, and longest. Chosen: a look reads a few
#: rows, and the quickest job takes a second.
_FIRST_PAUSE, _GROWTH, _LONGEST_PAUSE = 0.05, 1.5, 0.4


async def until_ended(look: Callable[[], State], has_ended: Callable[[State], bool], wait: float) -> State:
    """What a look gives once that has ended, or as it is after `wait` [s]."""
    deadline = time.monotonic() + wait
    pause = _FIRST_PAUSE
    while True:
        state = await run_in_threadpool(look)
        left = deadline - time.monotonic()
        if has_ended(state) or left <= 0:
            return state
        await asyncio.sleep(min(pause, left))
        pause = min(_GROWTH * pause, _LONGEST_PAUSE)
