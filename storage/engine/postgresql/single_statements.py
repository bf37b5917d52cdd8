"""Single statements outside transactions: what a service asks a server with every request, and what services share."""

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Engine, Executable, RowMapping
from sqlalchemy.exc import DBAPIError

from storage.engine.errors import StorageUnavailable
from storage.engine.postgresql.driver_errors import translated


class SingleStatements:
    """Threads share it. `engine` is one of `connect.make_autocommit_engine`, `name` that of the database in errors."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine
        self._name = name
        self._closed = False

    def rows(self, statement: Executable, values: dict[str, Any]) -> Sequence[RowMapping]:
        """The rows that a statement returns, none where it returns none. After a lost connection it is run once more.

        Raises StorageUnavailable where the server cannot be reached, or when this was closed, and DatabaseBusy where no
        connection is free in time.
        """
        self._refuse_closed()
        with translated(self._name):
            try:
                return self._run(statement, values)
            except DBAPIError as error:
                if not error.connection_invalidated:
                    raise
            # the server was started again: the connections of before have been dropped
            self._refuse_closed()
            return self._run(statement, values)

    def close(self) -> None:
        """Close the connections; any later use raises StorageUnavailable. May be called twice."""
        self._closed = True
        self._engine.dispose()

    def _run(self, statement: Executable, values: dict[str, Any]) -> Sequence[RowMapping]:
        with self._engine.connect() as connection:
            result = connection.execute(statement, values)
            return result.mappings().all() if result.returns_rows else ()

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self._name} has been closed")
