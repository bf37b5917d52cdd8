"""How work grows with the size of what it is given: time as a ratio between two sizes, memory beside the size itself."""

import time
import tracemalloc
from collections.abc import Callable

#: Ratio of times between sizes n and 4 n that still is linear work: 4, and as much again for a busy machine; squares are 16.
LINEAR = 9


def time_ratio(work: Callable[[int], object], small: int, *, repeats: int = 20) -> float:
    """Time of the processor for the work of size 4 · small over that of size small, the least of some trials each."""
    least = [min(_seconds(work, size, repeats) for _ in range(3)) for size in (small, 4 * small)]
    return least[1] / least[0]


def _seconds(work: Callable[[int], object], size: int, repeats: int) -> float:
    begun = time.process_time()
    for _ in range(repeats):
        work(size)
    return time.process_time() - begun


def peak(work: Callable[[], object]) -> int:
    """Bytes that the work holds at most, beyond what was there before."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
