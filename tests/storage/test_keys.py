"""Access keys: each function against a real database."""

from dataclasses import replace

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import IntegrityError

from storage import keys
from storage.engine.database import Database, GrantedKey
from storage.keys import KeyRow

#: When the tests are.
NOW = "2026-06-01T00:00:00+00:00"


def granted(database: Database, secret: str) -> GrantedKey | None:
    return database.watch.snapshot(None, secret).key


def key(key_id: str, secret: str, created_at: str = "2026-01-01T00:00:00Z") -> KeyRow:
    return KeyRow(key_id=key_id, scope="ingest", secret_sha256=secret, note="bench 3", created_at=created_at)


def test_a_key_opens_until_it_is_revoked(database: Database) -> None:
    watch = database.watch
    assert not watch.snapshot().keys_are_needed
    with database.writing() as connection:
        keys.insert(connection, key("k2", "bb"))
        keys.insert(connection, key("k1", "aa", "2026-02-01T00:00:00Z"))
        assert keys.any_active(connection, NOW)
    assert watch.snapshot().keys_are_needed
    assert [granted(database, secret) for secret in ("aa", "cc")] == [
        GrantedKey("k1", "ingest", "bench 3", None, None),
        None,
    ]
    with database.writing() as connection:
        assert keys.revoke(connection, "k2", "2026-03-01T00:00:00Z")
        assert not keys.revoke(connection, "k2", "2026-04-01T00:00:00Z")
        assert not keys.revoke(connection, "unknown", "2026-04-01T00:00:00Z")
        assert keys.any_active(connection, NOW)
    assert granted(database, "bb") is None
    with database.writing() as connection:
        keys.revoke(connection, "k1", "2026-03-02T00:00:00Z")
        assert not keys.any_active(connection, NOW)
        listed = keys.all_keys(connection)
    assert watch.snapshot().keys_are_needed, "revoking the last key opens nothing"
    assert [(row.key_id, row.revoked_at) for row in listed] == [
        ("k2", "2026-03-01T00:00:00Z"),
        ("k1", "2026-03-02T00:00:00Z"),
    ]


@pytest.mark.parametrize("second", [key("k1", "bb"), key("k2", "aa")])
def test_a_key_id_and_a_secret_are_taken_once(connection: Connection, second: KeyRow) -> None:
    keys.insert(connection, key("k1", "aa"))
    with pytest.raises(IntegrityError, match=r"(?i)unique"), connection.begin_nested():
        keys.insert(connection, second)


def test_a_key_keeps_its_clutches_and_its_last_use(database: Database) -> None:
    bound = replace(key("k1", "aa"), clutches=("c1", "c2"), expires_at="2026-05-01T00:00:00+00:00")
    with database.writing() as connection:
        assert not keys.any_ever(connection)
        keys.insert(connection, bound)
        assert keys.any_ever(connection)
        assert not keys.any_active(connection, NOW), "it has expired"
        assert keys.any_active(connection, "2026-04-30T00:00:00+00:00")
        keys.note_use(connection, "k1", NOW)
        assert keys.all_keys(connection) == [replace(bound, last_used_at=NOW)]
    assert granted(database, "aa") == GrantedKey("k1", "ingest", "bench 3", frozenset({"c1", "c2"}), bound.expires_at)
