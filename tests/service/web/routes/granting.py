"""Keys for a service in this process."""

from collections.abc import Mapping
from typing import Any

from fastapi.testclient import TestClient

from service.web.auth import Scope, make_key
from service.web.context import Context
from storage import keys

AT = "2026-11-02T10:00:00+00:00"


def context_of(client: TestClient) -> Context:
    """The parts of the service."""
    context = client.app.state.context  # type: ignore[attr-defined]
    assert isinstance(context, Context)
    return context


def granted(client: TestClient, scope: Scope = "read", **bounds: Any) -> Mapping[str, str]:
    """The header of a new key."""
    text, row = make_key(scope, scope, created_at=AT, **bounds)
    with context_of(client).database.writing() as connection:
        keys.insert(connection, row)
    return {"Authorization": f"Bearer {text}"}


def revoke_all(client: TestClient) -> None:
    """End every key."""
    with context_of(client).database.writing() as connection:
        for row in keys.all_keys(connection):
            keys.revoke(connection, row.key_id, AT)
