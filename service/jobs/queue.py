"""Diagnoses are made outside the process that answers: one at a time, each in a process of its own, in a bounded queue.

A process that takes too long or too much memory ends, and its diagnosis is stored as failed; one that was running when
the service itself ended is found at the next start. What is asked and how an end is stored the queue is given (`Store`).
"""

import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Protocol

from service.errors import BusyError
from service.logging import request_id
from service.settings import DATABASE_VARIABLE, Settings
from storage.diagnoses import NewDiagnosis
from storage.engine.errors import StorageError

INTERRUPTED = "the service ended while the diagnosis ran: ask again"
UNSTORED = "its report could not be stored: see the service's log"
#: Of what a diagnosis' process said, so many bytes are logged: its last ones hold the traceback.
_TAIL = 8000
#: Seconds by the clock that a diagnosis may take for each second of processor time that it may: it runs on idle processors
#: only, beside a full load for many times as long as alone. Chosen; no table. It ends a diagnosis that waits for ever.
CLOCK_PER_PROCESSOR_SECOND = 6.0
#: Memory that arrays gave back is kept for the next ones: having it mapped anew each time takes as long as what is
#: computed in it.
_MEMORY = {
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 30),
}
_log = logging.getLogger("clutchlife")


class Store(Protocol):
    """Where diagnoses are asked for and their ends stored."""

    def fail_running(self, problem: str) -> None:
        """Say of all diagnoses that an earlier service left running why they have no report."""

    def running(self, clutch_id: str) -> str | None:
        """The id of the diagnosis that is running of the very runs that are there now."""

    def ask(self, clutch_id: str) -> NewDiagnosis:
        """Store a diagnosis that is to be run. Raises NotFoundError."""

    def finish(self, asked_for: NewDiagnosis, ended: Mapping[str, Any], *, adopt_by: str | None) -> None:
        """Store how one ended (`report` and `extension`, or `problem`), and adopt what it found where somebody wants it."""


@dataclass(slots=True)
class Job:
    """A diagnosis that waits or runs; `done` is set once its end is stored. `adopt_by`: who wants its extension adopted;
    `request`: the id of the request that asked for it."""

    diagnosis: NewDiagnosis
    adopt_by: str | None
    request: str
    done: "Future[None]" = field(default_factory=Future)


class FailedError(Exception):
    """The diagnosis has no report; the message says why to the one who asked."""


class DiagnosisQueue:
    """The queue and the thread that works on it. `start` before anything is asked, `close` at the end."""

    def __init__(self, database_url: str, settings: Settings, store: Store) -> None:
        self._database_url = database_url
        self._settings = settings
        self._store = store
        self._jobs: dict[str, Job] = {}
        self._change = threading.Condition()
        self._closing = False
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._work, name="diagnoses", daemon=True)

    def start(self) -> None:
        """Begin, once it is stored that what an earlier service left running ended with it."""
        self._store.fail_running(INTERRUPTED)
        self._thread.start()

    def close(self) -> None:
        """End what runs, store that it ended, and stop."""
        with self._change:
            self._closing = True
            if self._process is not None:
                self._process.kill()
            self._change.notify_all()
        if self._thread.is_alive():  # else the service could not start, and what stopped it is to be seen
            self._thread.join()

    def is_working(self) -> bool:
        """Whether the thread that works on the queue is there."""
        return self._thread.is_alive()

    def waiting(self) -> int:
        """How many diagnoses wait or run."""
        return len(self._jobs)  # without the lock, which is held while a question waits for the database

    def ask(self, clutch_id: str, *, adopt_by: str | None) -> Job:
        """Have the clutch's runs diagnosed; joins the diagnosis of the very same runs where one waits or runs.

        Raises NotFoundError for an unknown clutch, BusyError where as many wait as may.
        """
        with self._change:
            waiting = self._jobs.get(self._store.running(clutch_id) or "")
            if waiting is not None:
                waiting.adopt_by = waiting.adopt_by or adopt_by
                return waiting
            if self._closing or len(self._jobs) >= self._settings.most_diagnoses:
                raise BusyError(f"{len(self._jobs)} diagnoses wait already: ask again in a little while")
            job = Job(self._store.ask(clutch_id), adopt_by, request_id.get())
            self._jobs[job.diagnosis.diagnosis_id] = job
            self._change.notify_all()
            return job

    def _work(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._jobs or self._closing)
                if not self._jobs:
                    return
                job = next(iter(self._jobs.values()))
            request_id.set(job.request)
            try:
                ended = self._outcome(job)
                self._store.finish(job.diagnosis, ended, adopt_by=job.adopt_by)
            except Exception:  # noqa: BLE001  (the next one is to be made all the same)
                _log.exception("diagnosis %s of %s", job.diagnosis.diagnosis_id, job.diagnosis.clutch_id)
                self._give_up(job)
            job.done.set_result(None)

    def _outcome(self, job: Job) -> dict[str, Any]:
        """Run one; what its process wrote, or a problem. From its end on nobody can join it."""
        try:
            return self._run(job)
        except FailedError as error:
            return {"problem": str(error)}
        finally:
            with self._change:
                del self._jobs[job.diagnosis.diagnosis_id]

    def _give_up(self, job: Job) -> None:
        """Its end could not be stored: say at least that it ended, or leave that to the next start."""
        try:
            self._store.finish(job.diagnosis, {"problem": UNSTORED}, adopt_by=None)
        except StorageError:
            _log.exception("diagnosis %s stays running until the next start", job.diagnosis.diagnosis_id)

    def _run(self, job: Job) -> dict[str, Any]:
        """What the process wrote. Raises FailedError."""
        task = {
            "clutch_id": job.diagnosis.clutch_id,
            "last_run_key": job.diagnosis.last_run_key,
            "engine": self._settings.engine,
            "bytes": self._settings.diagnosis_bytes,
            "processor_seconds": self._settings.diagnosis_seconds,
        }
        modules = "service.background", "service.jobs.diagnosis"
        # warnings of numerics are logged, those of libraries to their authors are not
        warned = "-W", "ignore", "-W", "default::RuntimeWarning"
        command = [sys.executable, "-P", *warned, "-m", *modules, json.dumps(task)]
        with tempfile.TemporaryFile() as answer, tempfile.TemporaryFile() as errors:
            with self._change:
                if self._closing:
                    raise FailedError(INTERRUPTED)
                # it ends when its standard input does, which is when this process does, however that comes
                self._process = subprocess.Popen(  # noqa: S603  (our own interpreter and module)
                    command,
                    stdin=subprocess.PIPE,
                    stdout=answer,
                    stderr=errors,
                    env=os.environ
                    | _MEMORY
                    | {DATABASE_VARIABLE: self._database_url},  # not an argument: others see those
                )
            code = self._ended(self._process)
            if code == -signal.SIGXCPU:
                raise FailedError(f"it took longer than {self._settings.diagnosis_seconds} s of processor time")
            errors.seek(max(0, errors.seek(0, os.SEEK_END) - _TAIL))
            output = errors.read().decode(errors="replace")
            if output:
                level = logging.ERROR if code else logging.WARNING
                _log.log(level, "diagnosis %s: %s", job.diagnosis.diagnosis_id, output)
            if code != 0:
                raise FailedError(
                    INTERRUPTED if self._closing else f"its process ended with {_ending(code)}: see the log"
                )
            answer.seek(0)
            written: dict[str, Any] = json.load(answer)
        return written

    def _ended(self, process: "subprocess.Popen[bytes]") -> int:
        """Wait for the process, at most as long as it may take; its exit code. Raises FailedError."""
        longest = self._settings.diagnosis_seconds * CLOCK_PER_PROCESSOR_SECOND
        try:
            return process.wait(timeout=longest)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise FailedError(f"it took longer than {longest:g} s by the clock") from None
        finally:
            with self._change:
                self._process = None
            if process.stdin is not None:
                process.stdin.close()


def _ending(code: int) -> str:
    try:
        return signal.Signals(-code).name if code < 0 else f"status {code}"
    except ValueError:
        return f"signal {-code}"
