"""How the process of a diagnosis is started."""

from typing import Any

import pytest

from service.jobs import child
from service.settings import DATABASE_VARIABLE, Settings

ADDRESS = "postgresql+psycopg://u:s3cr3t@host/db"


class StartedError(Exception):
    """In place of a process."""


def test_no_argument_shows_the_address_of_the_database(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other users of the machine see the arguments of a process, but not its environment."""
    started: dict[str, Any] = {}

    def start(command: list[str], **options: Any) -> None:
        started.update(options, command=command)
        raise StartedError

    monkeypatch.setattr(child.subprocess, "Popen", start)
    with pytest.raises(StartedError), child.running({"clutch_id": "c1"}, ADDRESS, Settings()):
        pytest.fail("it was not started")
    assert "s3cr3t" not in " ".join(started["command"])
    assert started["env"][DATABASE_VARIABLE] == ADDRESS
