"""What every request asks of a server: each question is one statement of its own, so that its answer is never older than the
question."""

from typing import Any

from sqlalchemy import BigInteger, Column, Engine, Executable, MetaData, Table, bindparam, exists, select, update
from sqlalchemy.engine import Row

from storage.engine.postgresql.driver_errors import translated
from storage.engine.watch import GrantedKey, Watch, granted
from storage.tables import access_key, clutch

#: One row: how many transactions that changed something were committed. Each raises it as its last statement, while it alone
#: writes, so that who reads a number also sees all that was committed up to it; the numbers of a sequence do not promise it.
#: PostgreSQL's alone: SQLite has `PRAGMA data_version`.
own_tables = MetaData()
commits = Table("commits", own_tables, Column("number", BigInteger, primary_key=True, autoincrement=False))
count_commit = update(commits).values(number=commits.c.number + 1)

_version = select(commits.c.number)
_revision = select(clutch.c.revision).where(clutch.c.clutch_id == bindparam("wanted"))
_key = select(
    access_key.c.key_id, access_key.c.scope, access_key.c.note, access_key.c.clutches, access_key.c.expires_at
).where(access_key.c.secret_sha256 == bindparam("secret"), access_key.c.revoked_at.is_(None))
_any_key = select(exists(select(access_key.c.key_id)))


class ServerWatch(Watch):
    """The questions, of connections that begin no transaction."""

    def __init__(self, engine: Engine, name: str) -> None:
        self._engine = engine.execution_options(isolation_level="AUTOCOMMIT")
        self._name = name

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
        """Whether a key was ever made."""
        row = self._first(_any_key)
        return row is not None and bool(row[0])

    def _first(self, query: Executable, **values: str) -> Row[Any] | None:
        with translated(self._name), self._engine.connect() as connection:
            return connection.execute(query, values).first()
