"""Diagnoses are made outside the process that answers: one at a time, each in a process of its own, in a bounded queue.

A process that takes too long or too much memory ends, and its diagnosis is stored as failed; one that was running when
the service itself ended is found at the next start.
"""

import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from service.errors import BusyError, ConflictError
from service.settings import Settings
from service.workflows import run_diagnosis
from service.workflows.adopt_model import adopt
from storage import diagnoses
from storage.engine.database import Database
from storage.engine.errors import StorageError

INTERRUPTED = "the service ended while the diagnosis ran: ask again"
_TAIL = 2000
#: One thread; and memory that arrays gave back is kept for the next ones: having it mapped anew each time takes as long as
#: what is worked out in it.
_NUMERICS = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MALLOC_MMAP_THRESHOLD_": str(32 << 20),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 30),
}
_log = logging.getLogger("clutchlife")


@dataclass(slots=True)
class Job:
    """A diagnosis that waits or runs; `done` is set once its end is stored. `adopt`: what it finds is to be adopted."""

    clutch_id: str
    diagnosis_id: str
    last_run_key: int
    adopt: bool
    done: "Future[None]" = field(default_factory=Future)


class FailedError(Exception):
    """The diagnosis has no report; the message says why to the one who asked."""


class Worker:
    """The queue and the thread that works on it. `start` before anything is asked, `close` at the end."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self._database = database
        self._settings = settings
        self._jobs: dict[str, Job] = {}
        self._change = threading.Condition()
        self._closing = False
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._work, name="diagnoses", daemon=True)

    def start(self) -> None:
        """Say of diagnoses that an earlier service left running that they ended with it, and begin."""
        with self._database.writing() as connection:
            diagnoses.fail_all(connection, _now(), INTERRUPTED)
        self._thread.start()

    def close(self) -> None:
        """End what runs, say so where it is stored, and stop."""
        with self._change:
            self._closing = True
            if self._process is not None:
                self._process.kill()
            self._change.notify_all()
        self._thread.join()

    def ask(self, clutch_id: str, *, adopt: bool) -> Job:
        """Have the clutch's runs diagnosed; joins the diagnosis of the very same runs where one waits or runs.

        Raises NotFoundError for an unknown clutch, BusyError where as many wait as may.
        """
        with self._change:
            with self._database.reading() as connection:
                known = self._jobs.get(run_diagnosis.running(connection, clutch_id) or "")
            if known is not None:
                known.adopt |= adopt
                return known
            if self._closing or len(self._jobs) >= self._settings.most_diagnoses:
                raise BusyError(f"{len(self._jobs)} diagnoses wait already: ask again in a little while")
            with self._database.writing() as connection:
                row = run_diagnosis.ask(connection, clutch_id, created_at=_now())
            job = Job(clutch_id, row.diagnosis_id, row.last_run_key, adopt)
            self._jobs[job.diagnosis_id] = job
            self._change.notify_all()
            return job

    def _work(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._jobs or self._closing)
                if not self._jobs:
                    return
                job = next(iter(self._jobs.values()))
            try:
                self._store(job, self._outcome(job))
            except Exception:  # noqa: BLE001  (the next one is to be made all the same)
                _log.exception("diagnosis %s of %s", job.diagnosis_id, job.clutch_id)
                self._give_up(job)
            job.done.set_result(None)

    def _outcome(self, job: Job) -> dict[str, Any]:
        """Run one; what its process says, or a problem. From its end on nobody can join it."""
        try:
            return self._run(job)
        except FailedError as error:
            return {"problem": str(error)}
        finally:
            with self._change:
                del self._jobs[job.diagnosis_id]

    def _store(self, job: Job, said: dict[str, Any]) -> None:
        """Store how one ended and, in the same transaction, adopt what it found where that was asked."""
        with self._database.writing() as connection:
            if "problem" in said:
                diagnoses.fail(connection, job.diagnosis_id, _now(), said["problem"])
                return
            diagnoses.finish(connection, job.diagnosis_id, _now(), said["report"], said["extension"])
            if job.adopt:
                with suppress(ConflictError):  # there is nothing to adopt, or a rebuild came meanwhile
                    adopt(connection, job.clutch_id, job.diagnosis_id, adopted_at=_now())

    def _give_up(self, job: Job) -> None:
        """Its end could not be stored: say at least that it ended, or leave that to the next start."""
        with suppress(StorageError), self._database.writing() as connection:
            diagnoses.fail(
                connection, job.diagnosis_id, _now(), "its report could not be stored: see the service's log"
            )

    def _run(self, job: Job) -> dict[str, Any]:
        """What the process says. Raises FailedError."""
        asked = {
            "database": f"sqlite:///{self._database.path.absolute()}",
            "clutch_id": job.clutch_id,
            "last_run_key": job.last_run_key,
            "engine": self._settings.engine,
            "bytes": self._settings.diagnosis_bytes,
        }
        command = [sys.executable, "-P", "-W", "ignore", "-m", "service.jobs.diagnosis", json.dumps(asked)]
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
                    env=os.environ | _NUMERICS,
                )
            code = self._ended(self._process)
            if code != 0:
                errors.seek(max(0, errors.seek(0, os.SEEK_END) - _TAIL))
                _log.error("diagnosis %s: %s", job.diagnosis_id, errors.read().decode(errors="replace"))
                raise FailedError(
                    INTERRUPTED if self._closing else f"its process ended with {_ending(code)}: see the log"
                )
            answer.seek(0)
            said: dict[str, Any] = json.load(answer)
        return said

    def _ended(self, process: "subprocess.Popen[bytes]") -> int:
        """Wait for the process, at most as long as it may take; its exit code. Raises FailedError."""
        try:
            return process.wait(timeout=self._settings.diagnosis_seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise FailedError(f"it took longer than {self._settings.diagnosis_seconds} s") from None
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


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
