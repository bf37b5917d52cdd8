"""Access keys. Only the hash of a secret is kept; a revoked key stays listed and grants nothing."""

from dataclasses import asdict, dataclass

import sqlalchemy as sa
from sqlalchemy import Connection, bindparam, exists, select, update

from storage.engine.watch import Watch
from storage.tables import access_key


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyRow:
    """A key: `secret_sha256` in hexadecimal, times ISO 8601, `revoked_at` None while it is active."""

    key_id: str
    scope: str
    secret_sha256: str
    note: str
    created_at: str
    revoked_at: str | None = None


_insert = sa.insert(access_key)
_active = access_key.c.revoked_at.is_(None)
_any_active = select(exists().where(_active))
_all = select(access_key).order_by(access_key.c.created_at, access_key.c.key_id)
_revoke = (
    update(access_key).where(access_key.c.key_id == bindparam("wanted"), _active).values(revoked_at=bindparam("at"))
)


def insert(connection: Connection, row: KeyRow) -> None:
    """Store a new key. Raises IntegrityError where its id or its secret is taken."""
    connection.execute(_insert, asdict(row))


def grants(watch: Watch, secret_sha256: str) -> tuple[str, str, str] | None:
    """The id, scope and note of the active key with this hash, without a transaction; None where there is none."""
    row = watch.row(
        "SELECT key_id, scope, note FROM access_key WHERE secret_sha256 = ? AND revoked_at IS NULL", secret_sha256
    )
    return None if row is None else (row[0], row[1], row[2])


def are_needed(watch: Watch) -> bool:
    """Whether any key is active, without a transaction."""
    row = watch.row("SELECT EXISTS (SELECT 1 FROM access_key WHERE revoked_at IS NULL)")
    return row is not None and bool(row[0])


def any_active(connection: Connection) -> bool:
    """Whether any key is active: without one the service binds to the loopback only."""
    return bool(connection.execute(_any_active).scalar_one())


def all_keys(connection: Connection) -> list[KeyRow]:
    """All keys, revoked ones too, oldest first."""
    return [KeyRow(**row._asdict()) for row in connection.execute(_all)]


def revoke(connection: Connection, key_id: str, revoked_at: str) -> bool:
    """Revoke a key; False where there is no active key of this id."""
    return connection.execute(_revoke, {"wanted": key_id, "at": revoked_at}).rowcount == 1
