"""Claims the jobs of the database and runs each in a process of its own.

Jobs are rows (`storage.jobs`), so any service on the database does them: who is free claims the next one and prolongs its
lease while it works. The job of a service that was killed is claimed by another which has seen no prolongation for as long
as a lease, by its own monotonic clock: a wall clock that is set takes no job from who works, and holds up none. One that was
cancelled, wherever that was asked for, is ended at the next prolongation. How a kind of job is done, and how its end is
stored, is a `JobKind`.
"""

import logging
import os
import secrets
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from typing import Any

from service.errors import BusyError
from service.jobs.process import AwayError, Child, FailedError, Work, running
from service.logging import request_id
from service.settings import MIB, Settings
from storage import jobs
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.errors import StorageError
from storage.jobs import Hold, JobRow

#: Seconds by the clock that a diagnosis may take for each second of processor time that it may: it runs on idle processors
#: only, beside a full load for many times as long as alone. Chosen; no table. It ends a diagnosis that waits for ever.
CLOCK_PER_PROCESSOR_SECOND = 6.0


@dataclass(frozen=True, slots=True)
class JobKind:
    """How jobs of one kind are done; `finish` stores the process's answer, or the `problem`."""

    work: Callable[[JobRow, Settings], Work]
    finish: Callable[[JobRow, Mapping[str, Any]], None]


def diagnosis_work(job: JobRow, settings: Settings) -> Work:
    """The task of a diagnosis's process. It only reads and computes, so all of it yields to other processes."""
    return Work(
        modules=("service.jobs.background", "service.jobs.diagnosis"),
        task={
            "clutch_id": job.clutch_id,
            "last_run_key": job.arguments["last_run_key"],
            "isolability": job.arguments.get("isolability", False),  # jobs of 1.0.0 have none
            "engine": settings.engine,
            "bytes": settings.diagnosis_memory_mb * MIB,
            "processor_seconds": settings.diagnosis_seconds,
        },
        longest=settings.diagnosis_seconds * CLOCK_PER_PROCESSOR_SECOND,
        processor_seconds=settings.diagnosis_seconds,
    )


def work_of_change(function: str) -> Callable[[JobRow, Settings], Work]:
    """A function from a job to its process's task, for jobs that store results. The thread that stores does not yield
    to other processes; the one that computes does.

    `function` is `module:function`, called as `replay.as_job` is.
    """

    def work(job: JobRow, settings: Settings) -> Work:
        """The task of a job's process."""
        task = {
            "function": function,
            "of": job.of,
            "at": job.started_at,
            "by": job.asked_by,
            "arguments": job.arguments,
        }
        return Work(modules=("service.jobs.change",), task=task, longest=settings.replay_hours * 3600.0)

    return work


#: How often a job is begun at most. Chosen: whatever ends the service once, as an operator may, is not the job's fault; what
#: ends it three times is.
MAX_ATTEMPTS = 3
GIVEN_UP = (
    f"the service or its database stopped {MAX_ATTEMPTS} times during this job: start it again, and tell the operator if it "
    "stops again"
)
UNSTORED = "the result could not be stored: see the service's log"
UNDONE = "an error stopped the job: see the service's log"
#: A lease is prolonged so many times before it would run out. Chosen: a database that is away for some seconds loses none.
RENEWALS_A_LEASE = 10
#: [s] Between two looks whether the service is to stop. Chosen: nobody waits for it.
_LOOK = 0.2
_log = logging.getLogger("clutchlife")


class Leases:
    """Since when each job has been held without renewal, by this process's own clock."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._since: dict[Hold, float] = {}

    def ended(self, holds: Sequence[Hold]) -> list[Hold]:
        """The present holds that have not been renewed during one lease."""
        now = time.monotonic()
        self._since = {hold: self._since.get(hold, now) for hold in holds}
        return [hold for hold, since in self._since.items() if now - since >= self._seconds]


class JobQueue:
    """The threads that run jobs. `start` it once the database is open, `close` it before the database closes."""

    def __init__(self, database: Database, settings: Settings, groups: Sequence[Mapping[str, JobKind]]) -> None:
        """`groups`: the kinds of jobs, by name; each group has one thread, which runs one job at a time."""
        self._database = database
        self._settings = settings
        self._lease = float(settings.job_lease_seconds)
        self._pause = self._lease / RENEWALS_A_LEASE
        self._name = f"{os.uname().nodename}:{os.getpid()}:{secrets.token_hex(4)}"
        self._change = threading.Condition()
        self._closing = False
        self._wakes = 0
        self._away = False
        self._threads = [
            threading.Thread(target=self._work, args=(group,), name="jobs", daemon=True) for group in groups
        ]

    def start(self) -> None:
        """Start the threads. A database file has one service, so its jobs held by an earlier process are released."""
        if self._database.path is not None:
            with self._database.writing() as connection:
                jobs.release_all(connection)
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Stop the threads: running jobs are interrupted and released, to be done later or by another service."""
        with self._change:
            self._closing = True
            self._change.notify_all()
        for thread in self._threads:
            if thread.is_alive():  # else the service could not start, and what stopped it is to be seen
                thread.join()

    def is_working(self) -> bool:
        return all(thread.is_alive() for thread in self._threads)

    def wake(self) -> None:
        """Look for new jobs now, because this service has just queued one."""
        with self._change:
            self._wakes += 1
            self._change.notify_all()

    def _work(self, group: Mapping[str, JobKind]) -> None:
        """Run the jobs of a group one after the other; if none is free, wait for `wake` or a pause."""
        seen, leases = 0, Leases(self._lease)

        def woken() -> bool:
            return self._wakes != seen or self._closing

        while not self._closing:
            try:
                job = self._claimed(group, leases)
                if job is not None:
                    self._do(job, group[job.kind])
                    continue
            except Exception:  # noqa: BLE001  (the next job is to be done whatever became of this one)
                _log.exception("a job could not be started")
            with self._change:
                self._change.wait_for(woken, self._pause)
                seen = self._wakes

    def _claimed(self, group: Mapping[str, JobKind], leases: Leases) -> JobRow | None:
        """The next job of a group, claimed by this service; None if there is none or the database is away."""
        try:
            with self._database.reading() as connection:
                ended = leases.ended(jobs.holds(connection, group))
                free = jobs.any_free(connection, group, ended)
            if not free:
                return None
            with self._database.writing(of=self._name) as connection:
                claimed = jobs.claim(connection, self._name, group, at=_now(), abandoned=ended)
        except StorageError as error:
            if not self._away:
                _log.warning("jobs wait for the database: %s", error)
            self._away = True
            return None
        self._away = False
        return claimed

    def _do(self, job: JobRow, kind: JobKind) -> None:
        """Run a claimed job and store its end; no error of it reaches the next job."""
        try:
            request_id.set(job.arguments["request"])
            ended = self._outcome(job, kind)
            if ended is not None:
                self._stored(job, kind, ended)
        except Exception:  # noqa: BLE001  (the next one is to be made all the same)
            _log.exception("%s %s of %s", job.kind, job.job_id, job.clutch_id)
            self._give_up(job, kind)

    def _stored(self, job: JobRow, kind: JobKind, ended: Mapping[str, Any]) -> None:
        """Store the job's end while its lease is renewed, because an adopted model is tracked again first."""
        done = threading.Event()
        renewing = threading.Thread(target=self._renew_until, args=(done, job), name="lease", daemon=True)
        renewing.start()
        try:
            for attempt in range(1, MAX_ATTEMPTS + 1):
                try:
                    return kind.finish(job, ended)
                except BusyError as error:
                    _log.warning(
                        "%s %s: its end could not be stored at attempt %d: %s", job.kind, job.job_id, attempt, error
                    )
                    if attempt == MAX_ATTEMPTS:
                        raise
        finally:
            done.set()
            renewing.join()

    def _renew_until(self, done: threading.Event, job: JobRow) -> None:
        """Prolong the job's lease until `done`."""
        while not done.wait(self._pause) and self._renewed(job, {"step": "stores"}):
            pass

    def _give_up(self, job: JobRow, kind: JobKind) -> None:
        """Mark the job as failed after its end could not be stored, by its kind's `finish` or else in its row alone; if
        both fail, the next claimer deals with it."""
        for end in (partial(kind.finish, job, {"problem": UNSTORED}), partial(self._end_as_failed, job)):
            try:
                end()
            except Exception:  # noqa: BLE001  (as above)
                _log.exception("%s %s: that it failed could not be stored", job.kind, job.job_id)
            else:
                break

    def _end_as_failed(self, job: JobRow) -> None:
        with self._database.writing(of=self._name) as connection:
            jobs.end(connection, job.job_id, jobs.FAILED, _now(), problem=UNSTORED, claimer=job.claimed_by)

    def _outcome(self, job: JobRow, kind: JobKind) -> Mapping[str, Any] | None:
        """The answer of the job's process, or its `problem`; None if this service must not end the job, because it is
        cancelled, held by another service, or to be repeated later."""
        if job.attempts > MAX_ATTEMPTS:
            return {"problem": GIVEN_UP}
        try:
            with running(kind.work(job, self._settings), self._database.url) as process:
                return process.written(f"{job.kind} {job.job_id}") if self._watch_to_end(job, process) else None
        except AwayError:
            _log.warning("%s %s is repeated once its lease has expired", job.kind, job.job_id)
            return None
        except FailedError as error:
            return {"problem": str(error)}
        except Exception:  # noqa: BLE001  (as where no process can be started)
            _log.exception("%s %s of %s", job.kind, job.job_id, job.clutch_id)
            return {"problem": UNDONE}

    def _watch_to_end(self, job: JobRow, process: Child) -> bool:
        """Wait for the process to end while the lease is renewed; false if the job must be stopped earlier. Raises
        FailedError."""
        due = time.monotonic() + self._pause
        while not process.ends_within(min(self._pause, _LOOK)):
            if self._closing:
                self._released(job)
                return False
            if time.monotonic() >= due:
                due = time.monotonic() + self._pause
                if not self._renewed(job, process.progress()):
                    return False
        return True

    def _released(self, job: JobRow) -> None:
        """Give the job back, so that another service may claim it at once."""
        try:
            with self._database.writing(of=self._name) as connection:
                jobs.release(connection, job.job_id, self._name)
        except StorageError as error:
            _log.warning("job %s is repeated once its lease has expired: %s", job.job_id, error)

    def _renewed(self, job: JobRow, progress: Json | None) -> bool:
        """Prolong the job's lease; false if this service holds it no longer or it was cancelled."""
        try:
            with self._database.writing(of=self._name) as connection:
                return jobs.renew(connection, job.job_id, self._name, progress=progress)
        except StorageError as error:
            _log.warning("job %s: the lease could not be prolonged: %s", job.job_id, error)
            return True


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
