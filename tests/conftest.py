"""What holds for all tests: how long a property's inputs take to draw is the machine's affair, and fails nothing.

And the one PostgreSQL server of those that need it."""

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from tests.storage.engine.postgresql.server import PostgresServer, postgresql_server

settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresServer]:
    with postgresql_server() as server:
        yield server
