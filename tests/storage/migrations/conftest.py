"""These tests are of files: a database on a server starts at the newest revision."""

import pytest

from storage.engine.database import Database


@pytest.fixture
def database(in_file: Database) -> Database:
    return in_file
