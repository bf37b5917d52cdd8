"""These tests are of files."""

import pytest

from storage.engine.database import Database


@pytest.fixture
def database(in_file: Database) -> Database:
    return in_file
