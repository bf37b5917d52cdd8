"""Journeys go to a service in a process of its own, over a real socket, where that is what they are about."""

from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import Browser

from tests.browser.driving import Watched, chromium
from tests.service.clients import client_on
from tests.support import Server, serving


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """A running service with an empty database."""
    with serving(tmp_path / "clutchlife.db", loaded=True) as running:
        yield running


@pytest.fixture
def http(tmp_path: Path) -> Iterator[httpx2.Client]:
    """A client of a service in this process: what is asked here is the same over a socket."""
    with client_on(f"sqlite:///{tmp_path}/a.db", max_body_mb=64) as client:
        yield client


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """A headless Chromium for all pages."""
    with chromium() as found:
        yield found


@pytest.fixture
def watched(browser: Browser, server: Server) -> Iterator[Watched]:
    """A page of the module's service."""
    found = Watched(browser, server.url)
    yield found
    found.close()
