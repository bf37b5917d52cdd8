"""A service in this process, with a database of its own for each test."""

import logging
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from tests.service.clients import client_on
from tests.storage.samples import lay_empty


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
    with client_on(database_url) as found:
        assert found.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        yield found
