"""What a kind of job is: the process that does it, how long that may take, and how its end is stored."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from service.jobs.child import Work
from service.settings import Settings
from storage.jobs import JobRow

#: Seconds by the clock that a diagnosis may take for each second of processor time that it may: it runs on idle processors
#: only, beside a full load for many times as long as alone. Chosen; no table. It ends a diagnosis that waits for ever.
CLOCK_PER_PROCESSOR_SECOND = 6.0
_SECONDS_PER_HOUR = 3600.0
#: Stores how a job ended: what its process answered, or its `problem`.
Finish = Callable[[JobRow, Mapping[str, Any]], None]


@dataclass(frozen=True, slots=True)
class Kind:
    """How a kind's jobs are done and ended."""

    work: Callable[[JobRow, Settings], Work]
    finish: Finish


def diagnosis(job: JobRow, settings: Settings) -> Work:
    """A diagnosis only reads and computes: all of its process yields to others."""
    task = {
        "clutch_id": job.clutch_id,
        "last_run_key": job.arguments["last_run_key"],
        "engine": settings.engine,
        "bytes": settings.diagnosis_bytes,
        "processor_seconds": settings.diagnosis_seconds,
    }
    return Work(
        modules=("service.background", "service.jobs.diagnosis"),
        task=task,
        longest=settings.diagnosis_seconds * CLOCK_PER_PROCESSOR_SECOND,
        processor_seconds=settings.diagnosis_seconds,
    )


def workflow(function: str) -> Callable[[JobRow, Settings], Work]:
    """A workflow stores what it computes, which the one thread of its process does that does not yield.

    `function` is `module:function`, called as `replay.as_job` is.
    """

    def work(job: JobRow, settings: Settings) -> Work:
        task = {"function": function, "clutch_id": job.clutch_id, "at": job.started_at}
        longest = settings.replay_hours * _SECONDS_PER_HOUR
        return Work(modules=("service.jobs.workflow",), task=task, longest=longest)

    return work
