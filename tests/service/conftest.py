"""A service in this process, with a database of its own for each test."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings


@pytest.fixture
def database_url(tmp_path: Path) -> str:
    """Where the test's database lies."""
    return f"sqlite:///{tmp_path / 'clutchlife.db'}"


@pytest.fixture
def client(database_url: str) -> Iterator[TestClient]:
    """A client on this machine, with one clutch registered."""
    app = create_app(Settings(workers=0, database=database_url, max_body_mb=1))
    with TestClient(
        app, base_url="http://127.0.0.1", client=("127.0.0.1", 50000), raise_server_exceptions=False
    ) as found:
        assert found.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        yield found
