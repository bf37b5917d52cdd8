"""Access keys. Only the hash of a secret is kept; a revoked key stays listed and grants nothing."""

from dataclasses import dataclass

from sqlalchemy import Connection, exists, or_, select, update

from storage.rows import Rows
from storage.tables import access_key


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyRow:
    """A key: `secret_sha256` in hexadecimal, times ISO 8601 in UTC, `revoked_at` None while it is active.

    `clutches` are those that it is bound to, None where it is bound to none. It grants nothing from `expires_at` on, where
    that is not None. `last_used_at` is noted once in a while.
    """

    key_id: str
    scope: str
    secret_sha256: str
    note: str
    created_at: str
    revoked_at: str | None = None
    clutches: tuple[str, ...] | None = None
    expires_at: str | None = None
    last_used_at: str | None = None


_rows = Rows(KeyRow)
_active = access_key.c.revoked_at.is_(None)


def insert(connection: Connection, row: KeyRow) -> None:
    """Store a new key. Raises IntegrityError where its id or its secret is taken."""
    connection.execute(access_key.insert(), _rows.values(row))


def any_ever(connection: Connection) -> bool:
    """Whether a key was ever created; from then on every request needs one."""
    return bool(connection.execute(select(exists(select(access_key.c.key_id)))).scalar_one())


def any_active(connection: Connection, at: str) -> bool:
    """Whether any key is valid at that time."""
    unexpired = or_(access_key.c.expires_at.is_(None), access_key.c.expires_at > at)
    return bool(connection.execute(select(exists().where(_active, unexpired))).scalar_one())


def all_keys(connection: Connection) -> list[KeyRow]:
    """All keys, revoked ones too, oldest first."""
    return _rows.all(connection.execute(select(access_key).order_by(access_key.c.created_at, access_key.c.key_id)))


def revoke(connection: Connection, key_id: str, revoked_at: str) -> bool:
    """Revoke a key; false if there is no active key of this id."""
    of_key = update(access_key).where(access_key.c.key_id == key_id, _active)
    return connection.execute(of_key.values(revoked_at=revoked_at)).rowcount == 1


def note_use(connection: Connection, key_id: str, at: str) -> None:
    connection.execute(update(access_key).where(access_key.c.key_id == key_id).values(last_used_at=at))
