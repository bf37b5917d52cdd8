"""A database of its own for every test: a file, and one on a PostgreSQL server.

Where a test asks, the file is in each of the two journal modes."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.engine.sqlite import connect
from tests.storage.engine.postgresql.server import PostgresServer


@pytest.fixture
def in_file(tmp_path: Path) -> Iterator[Database]:
    with closing(open_database(f"sqlite:///{tmp_path}/clutches.db")) as opened:
        yield opened


@pytest.fixture
def on_server(postgresql: PostgresServer) -> Iterator[Database]:
    url = postgresql.fresh()
    with closing(open_database(url)) as opened:
        yield opened
    postgresql.drop(url)


@pytest.fixture(params=["in_file", "on_server"])
def database(request: pytest.FixtureRequest) -> Database:
    opened: Database = request.getfixturevalue(request.param)
    return opened


@pytest.fixture(params=["delete", "wal"])
def journal_mode(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both modes are exercised: a file on a volume without shared memory keeps its rollback journal."""
    mode: str = request.param
    monkeypatch.setattr(connect, "JOURNAL_MODE", mode)
    return mode
