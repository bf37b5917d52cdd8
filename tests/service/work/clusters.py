"""A Dask cluster on this machine: a scheduler and workers in processes of their own, one of which may be killed."""

import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.service.work.waiting import until
from tests.support import free_port

ROOT = Path(__file__).parents[3]

Process = subprocess.Popen[bytes]


class LocalCluster:
    """The scheduler's address, and its workers' processes, of one thread each. What is killed stays dead without a nanny."""

    def __init__(self, folder: str, *, nanny: bool, **environment: str) -> None:
        self._folder, self._nanny = folder, "--nanny" if nanny else "--no-nanny"
        self.port = free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.workers: list[Process] = []
        self.scheduler = self._started(
            "scheduler", "--port", str(self.port), "--no-dashboard", "--no-show", **environment
        )
        until(self._answers)

    def add_worker(self, **environment: str) -> Process:
        """One more worker."""
        arguments = (self.address, "--nthreads", "1", self._nanny, "--no-dashboard", "--local-directory", self._folder)
        self.workers.append(self._started("worker", *arguments, **environment))
        return self.workers[-1]

    def close(self) -> None:
        """End all that was started."""
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait(30)

    def _started(self, kind: str, *arguments: str, **environment: str) -> Process:
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--host", "127.0.0.1", *arguments],
            env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
            cwd=self._folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def _answers(self) -> bool:
        assert self.scheduler.poll() is None, "the scheduler ended before it was ready"
        with suppress(OSError), socket.create_connection(("127.0.0.1", self.port), timeout=1):
            return True
        return False


@contextmanager
def local_cluster(workers: int, *, nanny: bool = False, **environment: str) -> Iterator[LocalCluster]:
    """A cluster with so many workers, ended at the end whatever happens. `environment`: the scheduler's."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        cluster = LocalCluster(folder, nanny=nanny, **environment)
        try:
            for _ in range(workers):
                cluster.add_worker()
            yield cluster
        finally:
            cluster.close()
