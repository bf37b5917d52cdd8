"""Work that waits for all other: diagnoses, answers made again, clutches tracked again under another fleet prior, replays.

python -m service.jobs.background MODULE ...    runs a module so, what it imports and all
"""

import ctypes
import multiprocessing
import os
import runpy
import sys
import threading
from collections.abc import Callable

from threadpoolctl import threadpool_limits

#: What libraries of linear algebra read when they are loaded.
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def use_one_blas_thread() -> None:
    """Limit linear algebra to one thread in this process, for libraries loaded already and later."""
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    threadpool_limits(limits=1, user_api="blas")


#: glibc's numbers of the two limits, and what they are set to. Chosen: the filters' arrays have up to 2 MB at 100 tests,
#: those of a raw record more than 8 MiB; with 32 MiB and 1 GiB a POST takes as long.
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_KEPT_FREE, _LARGEST_KEPT = 64 << 20, 8 << 20


def keep_memory() -> None:
    """Have this process keep freed array memory for the next arrays, if its C library can: mapping it again each time
    takes as long as the computation itself. Larger arrays are still mapped one by one."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_KEPT)
        mallopt(_M_TRIM_THRESHOLD, _KEPT_FREE)


def yield_to_others() -> None:
    """Have the calling thread, or the process if it has no other threads yet, run only on otherwise idle processors.

    On Linux this is the policy SCHED_IDLE: any other thread that wakes up treats such a processor as idle and starts at
    once. Beside a thread of the lowest priority (`nice` 19) it would wait for the next balancing; that is used on other
    systems, and if the policy is refused. Helper threads of linear algebra libraries do not yield, so this process no
    longer uses any.
    """
    use_one_blas_thread()
    if hasattr(os, "SCHED_IDLE"):
        try:
            os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        except OSError:  # as in a container whose filter of system calls is strict
            os.nice(19)
    else:
        os.nice(19)


def end_with_parent(end: Callable[[], object] = lambda: os._exit(3)) -> None:
    """Have this process end when its parent process ends, for whatever reason."""
    parent = multiprocessing.parent_process()

    def await_it() -> None:
        if parent is not None:
            parent.join()
            end()

    threading.Thread(target=await_it, daemon=True).start()


if __name__ == "__main__":
    yield_to_others()
    sys.argv = sys.argv[1:]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
