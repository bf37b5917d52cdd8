"""A file in each of the two journal modes, where a test asks. The databases of tests are those of `tests/conftest.py`."""

import pytest

from storage.engine.sqlite import connect


@pytest.fixture(params=["delete", "wal"])
def journal_mode(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both modes are exercised: a file on a volume without shared memory keeps its rollback journal."""
    mode: str = request.param
    monkeypatch.setattr(connect, "JOURNAL_MODE", mode)
    return mode
