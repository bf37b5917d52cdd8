"""A terminal whose service is in this process."""

from collections.abc import Callable
from contextlib import nullcontext

import pytest
from fastapi.testclient import TestClient

from service.cli import options
from tests.service.clients import clutchlife

Terminal = Callable[..., str]


@pytest.fixture
def terminal(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> Terminal:
    monkeypatch.setattr(options, "connect", lambda *_, **__: nullcontext(client))
    return clutchlife
