"""The process of one job. The service starts and watches it (`Child`), ends it where it takes too long, reads its answer;
the process itself ends when the service does, says how far it has come, and answers.
"""

import json
import logging
import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import IO, Any

from service.errors import exit_text
from service.settings import DATABASE_VARIABLE
from storage.encoding import Json, to_text

#: Of what a job's process said, so many bytes are logged: its last ones hold the traceback.
_TAIL = 8000
#: Memory that arrays gave back is kept for the next ones: having it mapped again each time takes as long as what is
#: computed in it.
_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(1 << 30)}
#: With this begins a line that says how far the job has come, JSON; its last line is the answer.
PROGRESS = b"progress "
#: The status with which a process ends that the database was away from: the job is to be done again.
AWAY = os.EX_TEMPFAIL
_log = logging.getLogger("clutchlife")


class AwayError(Exception):
    """The job was interrupted because the database was away for a while, and is to be repeated."""


class FailedError(Exception):
    """The job failed; the message tells its sender why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """The task of a worker process: it runs `modules` with `task` as their argument (JSON), for at most `longest` [s]
    of wall-clock time.

    `processor_seconds` is the processor time after which it ends itself, by SIGXCPU; None: it does not.
    """

    modules: tuple[str, ...]
    task: Mapping[str, Any]
    longest: float
    processor_seconds: int | None = None


class Child:
    """A running process. Made by `running`."""

    def __init__(self, process: "subprocess.Popen[bytes]", answer: IO[bytes], errors: IO[bytes], work: Work) -> None:
        self._process, self._answer, self._errors, self._work = process, answer, errors, work
        self._deadline = time.monotonic() + work.longest

    def ends_within(self, seconds: float) -> bool:
        """Wait up to this many seconds for the process to end; true once it has. Raises FailedError where it has taken
        too long by the clock."""
        try:
            self._process.wait(timeout=max(0.0, min(seconds, self._deadline - time.monotonic())))
        except subprocess.TimeoutExpired:
            if time.monotonic() < self._deadline:
                return False
            raise FailedError(f"the computation took longer than {self._work.longest:g} s") from None
        return True

    def progress(self) -> Json | None:
        """The latest progress that the process reported; None before its first report."""
        steps = [line for line in self._lines() if line.startswith(PROGRESS)]
        return json.loads(steps[-1].removeprefix(PROGRESS)) if steps else None

    def written(self, name: str) -> Mapping[str, Any]:
        """The answer that the ended process wrote; its error output is logged under the job's `name`.

        Raises FailedError; AwayError where the database did not answer, so that the job can be done again.
        """
        code = self._process.returncode
        if code == -signal.SIGXCPU:
            raise FailedError(f"the computation took longer than {self._work.processor_seconds} s of processor time")
        self._errors.seek(max(0, self._errors.seek(0, os.SEEK_END) - _TAIL))
        output = self._errors.read().decode(errors="replace")
        if output:
            _log.log(logging.ERROR if code else logging.WARNING, "%s: %s", name, output)
        if code == AWAY:
            raise AwayError
        if code != 0:
            if output:
                raise FailedError(f"the computation ended with {exit_text(code)}: see the service's log")
            raise FailedError(
                f"the computation was stopped ({exit_text(code)}), perhaps for want of memory: start it again. If it fails "
                "again, tell the operator of the service"
            )
        try:
            answer = json.loads(self._lines()[-1])
        except (ValueError, IndexError):
            answer = None
        if not isinstance(answer, dict):
            _log.error("%s: its process gave no readable answer", name)
            raise FailedError("the computation gave no readable answer: see the service's log")
        return answer

    def _lines(self) -> list[bytes]:
        """The complete lines that the process has written so far. Only this method moves the position in the file."""
        size = os.fstat(self._answer.fileno()).st_size
        return os.pread(self._answer.fileno(), size, 0).split(b"\n")[:-1]


@contextmanager
def running(work: Work, database_url: str) -> Iterator[Child]:
    """Context with a process that does the work; the process is killed at the end if it still runs."""
    # warnings of numerics are logged, those of libraries to their authors are not
    warned = "-W", "ignore", "-W", "default::RuntimeWarning"
    command = [sys.executable, "-P", *warned, "-m", *work.modules, json.dumps(work.task)]
    environment = os.environ | _MEMORY | {DATABASE_VARIABLE: database_url}  # not an argument: others see those
    with tempfile.TemporaryFile() as answer, tempfile.TemporaryFile() as errors:
        # it ends when its standard input does, which is when this process does, however that comes
        process = subprocess.Popen(  # noqa: S603  (our own interpreter and module)
            command, stdin=subprocess.PIPE, stdout=answer, stderr=errors, env=environment
        )
        try:
            yield Child(process, answer, errors, work)
        finally:
            process.kill()
            process.wait()
            if process.stdin is not None:
                process.stdin.close()


def end_with_the_service() -> None:
    """Have this process end when its service ends, for whatever reason, and write no core dump."""

    def await_end() -> None:  # of standard input, a pipe held open by the service
        while os.read(0, 1):  # not by way of sys.stdin, whose lock would be in the way when this process ends
            pass
        os._exit(3)

    threading.Thread(target=await_end, daemon=True).start()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def say(progress: Json) -> None:
    sys.stdout.write(f"{PROGRESS.decode()}{to_text(progress)}\n")
    sys.stdout.flush()


def answer(ended: Mapping[str, Any]) -> None:
    """Write the answer, the last line of the process's output."""
    sys.stdout.write(f"{json.dumps(ended, allow_nan=False)}\n")
