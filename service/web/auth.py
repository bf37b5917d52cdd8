"""Who may do what: bearer keys with a scope; without any key, this machine only.

Scopes contain each other: `admin` may do what `ingest` may, `ingest` what `read` may. A key is shown once; only its
sha256 is stored. Without keys a request must come from a loopback address and name a loopback host, so that no page in a
browser can reach the service under a name of its own.
"""

import hashlib
import ipaddress
import secrets
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Literal, get_args

from fastapi import Depends, Request

from service.errors import FieldError, ForbiddenError, InvalidError, UnauthorizedError
from service.web.context import Context
from storage import keys
from storage.engine.watch import Watch
from storage.keys import KeyRow

Scope = Literal["read", "ingest", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
#: The caller's name where no keys are configured.
LOCAL = "local"


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller:
    """What a request tells of its sender."""

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


def authorise(watch: Watch, caller: Caller, scope: Scope) -> str:
    """Let the caller pass and return its name, or raise UnauthorizedError or ForbiddenError."""
    if not keys.are_needed(watch):
        _require_loopback(caller)
        return LOCAL
    scheme, _, text = (caller.authorization or "").partition(" ")
    if scheme.lower() != "bearer" or not text:
        raise UnauthorizedError("send a key as: Authorization: Bearer KEY")
    granted = keys.grants(watch, _digest(text.strip()))
    if granted is None:
        raise UnauthorizedError("the key is not known, or was revoked")
    key_id, its_scope, note = granted
    if its_scope not in SCOPES[SCOPES.index(scope) :]:
        raise ForbiddenError(f"this needs the scope {scope}, the key has {its_scope}")
    return f"key:{key_id} {note}".rstrip()


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


@lru_cache(maxsize=256)
def is_loopback(name: str) -> bool:
    """Whether a host name or address is this machine's own."""
    if name.lower().rstrip(".") == "localhost":
        return True
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False


def context_of(request: Request) -> Context:
    """The running service's context."""
    context = request.app.state.context
    assert isinstance(context, Context)  # noqa: S101  (set when the service starts)
    return context


def caller_of(request: Request) -> Caller:
    """What the request tells of its sender."""
    return Caller(
        authorization=request.headers.get("authorization"),
        address=None if request.client is None else request.client.host,
        host=request.headers.get("host"),
        origin=request.headers.get("origin"),
    )


def allowed(scope: Scope) -> Callable[[Request], Awaitable[Context]]:
    """A dependency that gives the context to callers with that scope and stops the others."""

    async def check(request: Request) -> Context:
        context = context_of(request)
        _refuse_unknown_arguments(request)
        request.state.caller = authorise(context.database.watch, caller_of(request), scope)
        return context

    return check


def name_of_caller(request: Request) -> str:
    """Who sent a request that was allowed, as the audit trail names it: a key's id and note, or `local`."""
    name: str = request.state.caller
    return name


#: Tables and short lists are answered whole, and take the arguments of a list.
_OF_LISTS = {"limit", "cursor"}


def _refuse_unknown_arguments(request: Request) -> None:
    """A mistyped argument must not be answered as if it had not been there."""
    if not request.scope["query_string"]:
        return
    route = request.scope["route"]
    arguments = {field.alias for field in route.dependant.query_params} | _OF_LISTS
    unknown = [name for name in request.query_params if name not in arguments]
    if unknown:
        errors = [
            FieldError(
                pointer=f"/query/{name}",
                code="extra_forbidden",
                message=f"{name} is no argument here; there are: {', '.join(sorted(arguments)) or 'none'}",
                value=request.query_params[name][:80],
            )
            for name in unknown
        ]
        raise InvalidError(errors[0].message, errors=errors)


Reader = Annotated[Context, Depends(allowed("read"))]
Ingester = Annotated[Context, Depends(allowed("ingest"))]
