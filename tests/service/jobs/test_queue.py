"""How the queue starts the process of a diagnosis."""

from typing import Any

import pytest

from service.jobs import queue
from service.jobs.queue import DiagnosisQueue, Job
from service.settings import DATABASE_VARIABLE, Settings
from tests.storage.samples import new_diagnosis

ADDRESS = "postgresql+psycopg://u:s3cr3t@host/db"


class StartedError(Exception):
    """In place of a process."""


def test_no_argument_shows_the_address_of_the_database(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other users of the machine see the arguments of a process, but not its environment."""
    started: dict[str, Any] = {}

    def start(command: list[str], **options: Any) -> None:
        started.update(options, command=command)
        raise StartedError

    monkeypatch.setattr(queue.subprocess, "Popen", start)
    diagnoses = DiagnosisQueue(ADDRESS, Settings(), store=None)
    with pytest.raises(StartedError):
        diagnoses._run(Job(new_diagnosis(0), None, "request"))
    assert "s3cr3t" not in " ".join(started["command"])
    assert started["env"][DATABASE_VARIABLE] == ADDRESS
