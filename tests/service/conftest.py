"""A service in this process, with a database of its own for each test."""

import logging
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest
from fastapi.testclient import TestClient

from service.dashboard import assets, pages
from tests.service.clients import client_of
from tests.storage.samples import lay_empty


@pytest.fixture(scope="session", autouse=True)
def _pages_are_read_once() -> Iterator[None]:
    """And not for each service, of which it is half of the start."""
    routes = cache(lambda: pages.router(assets.load()))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("service.app.assets", SimpleNamespace(load=lambda: None))
        patched.setattr("service.app.dashboard", SimpleNamespace(router=lambda _: routes()))
        yield


@pytest.fixture(autouse=True)
def unchanged_loggers() -> Iterator[None]:
    """What `configure` changes is of the whole process."""
    root = logging.getLogger()
    names = (None, "clutchlife", "uvicorn")
    handlers, levels = list(root.handlers), [logging.getLogger(name).level for name in names]
    yield
    logging.captureWarnings(False)
    root.handlers[:] = handlers
    for name, level in zip(names, levels, strict=True):
        logging.getLogger(name).setLevel(level)


@pytest.fixture
def database_url(tmp_path: Path) -> str:
    """Where the test's database lies."""
    lay_empty(tmp_path / "clutchlife.db")
    return f"sqlite:///{tmp_path / 'clutchlife.db'}"


@pytest.fixture
def client(database_url: str) -> Iterator[TestClient]:
    """A client on this machine, with one clutch registered."""
    with client_of(Path(database_url.removeprefix("sqlite:///"))) as found:
        yield found


@pytest.fixture(scope="module")
def shared_client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """The same, one for all tests of a module that leave nothing behind: a service takes 0.07 s to start."""
    with client_of(tmp_path_factory.mktemp("shared") / "clutchlife.db") as found:
        yield found
