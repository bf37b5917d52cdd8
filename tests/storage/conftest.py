"""A transaction on either database, and a file in each of the two journal modes, where a test asks. The databases of tests
are those of `tests/conftest.py`."""

from collections.abc import Iterator

import pytest
from sqlalchemy import Connection

from storage import clutches
from storage.engine.database import Database
from storage.engine.sqlite import connect
from tests.storage.samples import CLUTCH, clutch_row


@pytest.fixture
def connection(database: Database) -> Iterator[Connection]:
    """A transaction that writes, where a clutch is and another one."""
    with database.writing() as found:
        for name in (CLUTCH, "other"):
            clutches.insert(found, clutch_row(name))
        yield found


@pytest.fixture(params=["delete", "wal"])
def journal_mode(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both modes are exercised: a file on a volume without shared memory keeps its rollback journal."""
    mode: str = request.param
    monkeypatch.setattr(connect, "JOURNAL_MODE", mode)
    return mode
