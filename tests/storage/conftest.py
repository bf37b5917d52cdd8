"""A database in a file of its own, in the usual journal mode and, where a test asks, in each of the two."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.engine.sqlite import connect


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = open_database(f"sqlite:///{tmp_path}/clutches.db")
    yield opened
    opened.close()


@pytest.fixture(params=["delete", "wal"])
def journal_mode(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both modes are exercised: a file on a volume without shared memory keeps its rollback journal."""
    mode: str = request.param
    monkeypatch.setattr(connect, "JOURNAL_MODE", mode)
    return mode
