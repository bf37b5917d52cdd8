"""A terminal whose service is in this process."""

from collections.abc import Callable
from contextlib import nullcontext

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from service.cli import options
from service.cli.main import app

Terminal = Callable[..., str]


@pytest.fixture
def terminal(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Types a command and `answers` to its questions; what it prints."""
    monkeypatch.setattr(options, "connect", lambda *_, **__: nullcontext(client))

    def typed(*arguments: object, answers: str = "", code: int = 0) -> str:
        done = CliRunner().invoke(app, list(map(str, arguments)), input=answers, env={"COLUMNS": "200"})
        assert done.exit_code == code, done.output
        return done.output

    return typed
