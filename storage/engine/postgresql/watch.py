"""What every request asks of a server: each question is one statement of its own, so that its answer is never older than the
question."""

from typing import Any

from sqlalchemy import Engine, Executable, bindparam, exists, select
from sqlalchemy.engine import Row
from sqlalchemy.exc import DBAPIError

from storage.engine.postgresql.driver_errors import translated
from storage.engine.postgresql.own_tables import commits
from storage.engine.watch import GrantedKey, Watch, granted
from storage.tables import access_key, clutch

_version = select(commits.c.number)
_revision = select(clutch.c.revision).where(clutch.c.clutch_id == bindparam("wanted"))
_key = select(
    access_key.c.key_id, access_key.c.scope, access_key.c.note, access_key.c.clutches, access_key.c.expires_at
).where(access_key.c.secret_sha256 == bindparam("secret"), access_key.c.revoked_at.is_(None))
_any_key = select(exists(select(access_key.c.key_id)))


class ServerWatch(Watch):
    """The questions, of connections that begin no transaction: `engine` is for such (`connect.make_asking_engine`)."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine
        self._name = name
        self._keys_were_made = False

    def version(self) -> int:
        """The number of commits."""
        row = self._first(_version)
        return 0 if row is None else int(row[0])

    def revision(self, clutch_id: str) -> int | None:
        """The clutch's revision, or None."""
        row = self._first(_revision, wanted=clutch_id)
        return None if row is None else int(row[0])

    def key(self, secret_sha256: str) -> GrantedKey | None:
        """What the key with this hash grants, or None."""
        row = self._first(_key, secret=secret_sha256)
        return None if row is None else granted(tuple(row))

    def keys_are_needed(self) -> bool:
        """Whether a key was ever made; that it was is never asked again."""
        if not self._keys_were_made:
            row = self._first(_any_key)
            self._keys_were_made = row is not None and bool(row[0])
        return self._keys_were_made

    def _first(self, query: Executable, **values: str) -> Row[Any] | None:
        with translated(self._name):
            try:
                return self._asked(query, values)
            except DBAPIError as error:
                if not error.connection_invalidated:
                    raise
            # the server was started again: the connections of before have been dropped
            return self._asked(query, values)

    def _asked(self, query: Executable, values: dict[str, str]) -> Row[Any] | None:
        with self._engine.connect() as connection:
            return connection.execute(query, values).first()
