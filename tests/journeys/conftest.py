"""Journeys go to a service in a process of its own, over a real socket."""

from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from tests.support import Server, serving


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A running service with an empty database."""
    with serving(tmp_path / "clutchlife.db") as found:
        yield found


@pytest.fixture
def http(server: Server) -> Iterator[httpx2.Client]:
    """A client for it."""
    with httpx2.Client(base_url=server.url, timeout=60) as found:
        yield found
