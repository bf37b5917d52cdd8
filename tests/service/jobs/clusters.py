"""A Dask cluster on this machine: a scheduler and workers in processes of their own, one of which may be killed."""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from tests.service.jobs.waiting import until
from tests.support import free_port

ROOT = Path(__file__).parents[3]

Process = subprocess.Popen[bytes]


@dataclass(frozen=True)
class LocalCluster:
    """The scheduler's address and process, and its workers' processes, of one thread each."""

    address: str
    scheduler: Process
    workers: list[Process]


@contextmanager
def local_cluster(workers: int, *, nanny: bool = False, **environment: str) -> Iterator[LocalCluster]:
    """A cluster with so many workers, ended at the end whatever happens; what is killed stays dead without a nanny.
    `environment`: the scheduler's."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder, ExitStack() as stack:

        def started(kind: str, *arguments: str, **variables: str) -> Process:
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--host", "127.0.0.1", *arguments],
                env=os.environ | {"PYTHONPATH": str(ROOT)} | variables,
                cwd=folder,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )
            stack.callback(process.wait, 30)
            stack.callback(process.kill)
            return process

        def answers() -> bool:
            assert scheduler.poll() is None, "the scheduler ended before it was ready"
            with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
                return True
            return False

        scheduler = started("scheduler", "--port", str(port), "--no-dashboard", "--no-show", **environment)
        until(answers)
        kept = (address, "--nthreads", "1", "--nanny" if nanny else "--no-nanny", "--no-dashboard")
        made = [started("worker", *kept, "--local-directory", folder) for _ in range(workers)]
        yield LocalCluster(address, scheduler, made)
