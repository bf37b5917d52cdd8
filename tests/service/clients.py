"""Clients of a service in this process."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from tests.storage.samples import lay_empty


@contextmanager
def client_on(database_url: str, **settings: Any) -> Iterator[TestClient]:
    """A client on this machine of a service on that database, in this process."""
    if database_url.startswith("sqlite:///"):
        lay_empty(Path(database_url.removeprefix("sqlite:///")))
    app = create_app(Settings(workers=0, database=database_url, **({"max_body_mb": 1} | settings)))
    with TestClient(
        app, base_url="http://127.0.0.1", client=("127.0.0.1", 50000), raise_server_exceptions=False
    ) as found:
        yield found
