"""The one option by which an executor is chosen."""

import os

from service.defaults import SCHEDULERS
from service.executors.cluster import Cluster
from service.executors.executor import Executor
from service.executors.in_process import InProcess
from service.executors.processes import Processes

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
