"""Work that waits for all other: diagnoses, answers made anew, clutches tracked anew under another fleet prior."""

import os

from threadpoolctl import threadpool_limits


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
