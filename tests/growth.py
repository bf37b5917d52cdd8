"""How work grows with the size of what it is given: time beside that of as much in small parts, memory beside the size."""

import gc
import time
import tracemalloc
from collections.abc import Callable

#: How far apart the two sizes are that are compared.
APART = 16
#: Most that the ratio of times may be: linear work has 1, squares have 16, and this is as far from both.
LINEAR = APART**0.5
#: Trials of which the fastest counts; a machine that is busy during one of them is not during all.
TRIALS = 5


def time_ratio(work: Callable[[int], object], small: int, *, repeats: int = 1) -> float:
    """Time of the processor for the work of size 16 · small over that for 16 times the work of size small.

    Both take about as long where the work is linear, are measured by turns, and no garbage is collected meanwhile: what else
    the machine does meets both alike. The least of each counts; further trials are made only while the ratio is too large.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        least = [float("inf"), float("inf")]
        for _ in range(TRIALS):
            for number, (size, times) in enumerate(((small, APART * repeats), (APART * small, repeats))):
                gc.collect()
                least[number] = min(least[number], _seconds(work, size, times))
            if least[1] < LINEAR * least[0]:
                break
        return least[1] / least[0]
    finally:
        if collecting:
            gc.enable()


def _seconds(work: Callable[[int], object], size: int, times: int) -> float:
    begun = time.process_time()
    for _ in range(times):
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
