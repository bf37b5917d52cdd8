"""Access keys: each function against a real file."""

import pytest
from sqlalchemy.exc import IntegrityError

from storage import keys
from storage.engine.database import Database
from storage.keys import KeyRow


def key(key_id: str, secret: str, created_at: str = "2026-01-01T00:00:00Z") -> KeyRow:
    return KeyRow(key_id=key_id, scope="ingest", secret_sha256=secret, note="bench 3", created_at=created_at)


def test_a_key_opens_until_it_is_revoked(database: Database) -> None:
    watch = database.watch
    assert not keys.are_needed(watch)
    with database.writing() as connection:
        keys.insert(connection, key("k2", "bb"))
        keys.insert(connection, key("k1", "aa", "2026-02-01T00:00:00Z"))
        assert keys.any_active(connection)
    assert keys.are_needed(watch)
    assert [keys.grants(watch, secret) for secret in ("aa", "cc")] == [("k1", "ingest", "bench 3"), None]
    with database.writing() as connection:
        assert keys.revoke(connection, "k2", "2026-03-01T00:00:00Z")
        assert not keys.revoke(connection, "k2", "2026-04-01T00:00:00Z")
        assert not keys.revoke(connection, "unknown", "2026-04-01T00:00:00Z")
        assert keys.any_active(connection)
    assert keys.grants(watch, "bb") is None
    with database.writing() as connection:
        keys.revoke(connection, "k1", "2026-03-02T00:00:00Z")
        assert not keys.any_active(connection)
        listed = keys.all_keys(connection)
    assert not keys.are_needed(watch)
    assert [(row.key_id, row.revoked_at) for row in listed] == [
        ("k2", "2026-03-01T00:00:00Z"),
        ("k1", "2026-03-02T00:00:00Z"),
    ]


@pytest.mark.parametrize("second", [key("k1", "bb"), key("k2", "aa")])
def test_a_key_id_and_a_secret_are_taken_once(database: Database, second: KeyRow) -> None:
    with database.writing() as connection:
        keys.insert(connection, key("k1", "aa"))
    with pytest.raises(IntegrityError, match="UNIQUE"), database.writing() as connection:
        keys.insert(connection, second)
