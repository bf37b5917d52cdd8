"""Who may do what: bearer keys with a scope; without any key, this machine only.

Scopes contain each other: `admin` may do what `ingest` may, `ingest` what `read` may. A key is shown once; only its
sha256 is stored. Without keys a request must come from a loopback address and name a loopback host, so that no page in a
browser can reach the service under a name of its own.
"""

import hashlib
import ipaddress
import secrets
from dataclasses import dataclass
from typing import Literal, get_args

from service.errors import ForbiddenError, UnauthorizedError
from storage import keys
from storage.engine.database import Database
from storage.keys import KeyRow

Scope = Literal["read", "ingest", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller:
    """What a request says of its sender."""

    authorization: str | None
    address: str | None
    host: str | None
    origin: str | None


def make_key(scope: Scope, note: str, *, created_at: str) -> tuple[str, KeyRow]:
    """A new secret, and the row that knows only its hash."""
    key_id, secret = secrets.token_hex(4), secrets.token_urlsafe(32)
    text = f"clutchlife_{key_id}_{secret}"
    row = KeyRow(
        key_id=key_id, scope=scope, secret_sha256=_digest(text), note=note, created_at=created_at, revoked_at=None
    )
    return text, row


def authorise(database: Database, caller: Caller, scope: Scope) -> None:
    """Let the caller pass, or raise UnauthorizedError or ForbiddenError."""
    with database.reading() as connection:
        if not keys.any_active(connection):
            _require_loopback(caller)
            return
        scheme, _, text = (caller.authorization or "").partition(" ")
        if scheme.lower() != "bearer" or not text:
            raise UnauthorizedError("send a key as: Authorization: Bearer KEY")
        key = keys.by_secret_hash(connection, _digest(text.strip()))
    if key is None:
        raise UnauthorizedError("the key is not known, or was revoked")
    if key.scope not in SCOPES[SCOPES.index(scope) :]:
        raise ForbiddenError(f"this needs the scope {scope}, the key has {key.scope}")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _require_loopback(caller: Caller) -> None:
    if caller.address is not None and not is_loopback(caller.address):
        raise ForbiddenError(f"no keys are configured: only this machine may ask, not {caller.address}")
    host = (caller.host or "").strip()
    if not is_loopback(_name(host)):
        raise ForbiddenError(f"no keys are configured: the service answers as localhost only, not as {host[:80]!r}")
    if caller.origin is not None and caller.origin.partition("://")[2] != host:
        raise ForbiddenError(f"no keys are configured: a page of {caller.origin[:80]!r} may not ask")


def _name(host: str) -> str:
    return host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]


def is_loopback(name: str) -> bool:
    """Whether a host name or address is this machine's own."""
    if name.lower().rstrip(".") == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False
