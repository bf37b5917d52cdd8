"""Decides who may do what: keys have a scope, and may be bound to clutches.

Scopes contain each other: `read` looks; `ingest` also adds (clutches, runs, diagnoses); `admin` also changes what stands
(edits, withdraws, corrects, adopts). A key is shown once; only its sha256 is stored. Once a key was made one is needed for
ever. Before that a request must come from a loopback address, not through a proxy, and name a loopback host, so that no page
in a browser can reach the service under a name of its own.
"""

import hashlib
import ipaddress
import secrets
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from typing import Annotated, Any, Literal, get_args

from fastapi import Depends, Request

from service.api.base import LONGEST_IDENTIFIER
from service.errors import FieldError, ForbiddenError, InvalidError, UnauthorizedError
from service.web.context import Context
from storage.engine.database import GrantedKey, Question, Snapshot
from storage.keys import KeyRow

Scope = Literal["read", "ingest", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
#: What a request is called that no route answers.
UNMATCHED = "unmatched"
#: Headers by which proxies say that a request is another's; those whose names hold or end in one of the others, too. And the
#: version in which a proxy asks that adds no header: nginx, where it is not told otherwise; no browser has it.
_OF_PROXIES = {b"via", b"x-real-ip", b"cf-connecting-ip", b"x-envoy-external-address", b"x-original-host", b"cdn-loop"}
_FORWARDED, _CLIENT_IP = b"forwarded", b"client-ip"
_VERSION_OF_PROXIES = "1.0"


@dataclass(frozen=True, slots=True, kw_only=True)
class Grant:
    """A caller's permissions, under its name in the audit trail: a key's id and note, or `local`.

    `clutches` is None if all are allowed, `key_id` is None if no key exists.
    """

    name: str
    scope: Scope
    clutches: frozenset[str] | None = None
    key_id: str | None = None


_MAKE_ONE = "make a key with clutchlife key create"
_LOCAL_GRANT = Grant(name="local", scope="admin")


def make_key(
    scope: Scope, note: str, *, created_at: str, clutches: Iterable[str] | None = None, days: float | None = None
) -> tuple[str, KeyRow]:
    """Create a key: returns its secret, and its row with only the secret's hash. The key is bound to `clutches` and
    expires after that many days."""
    key_id, secret = secrets.token_hex(4), secrets.token_urlsafe(32)
    text = f"clutchlife_{key_id}_{secret}"
    row = KeyRow(
        key_id=key_id,
        scope=scope,
        secret_sha256=_digest(text),
        note=note,
        created_at=created_at,
        clutches=None if clutches is None else tuple(sorted(set(clutches))),
        expires_at=None if days is None else _stamp(datetime.now(UTC) + timedelta(days=days)),
    )
    return text, row


def authorise(
    request: Request, snapshot: Snapshot, scope: Scope, clutch_id: str | None, *, narrowed: bool = False
) -> Grant:
    """Return the caller's grant if it may make this request. Raises UnauthorizedError or ForbiddenError.

    `snapshot` has the caller's key; `clutch_id` is the requested clutch, None if the request is about all of them. A
    key bound to clutches may be used for one of them, or on routes that filter by the key's clutches themselves
    (`narrowed`).
    """
    grant = identify(request, snapshot)
    require_scope(grant, scope)
    request.state.grant = grant
    if not narrowed:
        require_clutch(grant, clutch_id)
    return grant


def identify(request: Request, snapshot: Snapshot) -> Grant:
    """The grant of a caller. Raises UnauthorizedError, or ForbiddenError if no key exists and the caller is not local."""
    if not snapshot.keys_are_needed:
        if not context_of(request).settings.insecure_local:
            _require_direct(request)
        _require_own_host(request)
        return _LOCAL_GRANT
    if _key_of(request) is None:
        raise UnauthorizedError("send a key as: Authorization: Bearer KEY")
    key = snapshot.key
    if key is None:
        raise UnauthorizedError("the key is unknown or was revoked: ask for a new one")
    if key.expires_at is not None and key.expires_at <= _stamp(datetime.now(UTC)):
        raise UnauthorizedError(f"the key expired at {key.expires_at}: ask for a new one")
    return _grant(key)


def _key_of(request: Request) -> str | None:
    scheme, _, text = request.headers.get("authorization", "").partition(" ")
    return text.strip() if scheme.lower() == "bearer" and text else None


async def snapshot_at(request: Request, clutch_id: str | None) -> Snapshot:
    """The caller's key and the clutch's revision, read in one look and kept with the request for later use."""
    key = _key_of(request)
    if clutch_id is not None and len(clutch_id) > LONGEST_IDENTIFIER:
        clutch_id = None  # no clutch is called so: the key is checked alone, and then there is no such clutch
    question = Question(clutch_id, None if key is None else _digest(key))
    snapshot = await context_of(request).database.watch.look(question)
    request.state.snapshot = snapshot
    return snapshot


def snapshot_of(request: Request) -> Snapshot:
    snapshot: Snapshot = request.state.snapshot
    return snapshot


@lru_cache(maxsize=256)
def _grant(key: GrantedKey) -> Grant:
    (scope,) = (scope for scope in SCOPES if scope == key.scope)
    name = f"key:{key.key_id} {key.note}".rstrip()
    return Grant(name=name, scope=scope, clutches=key.clutches, key_id=key.key_id)


def require_scope(grant: Grant, scope: Scope) -> None:
    """Raise ForbiddenError if the grant does not include the scope."""
    if SCOPES.index(grant.scope) < SCOPES.index(scope):
        raise ForbiddenError(f"the key has the scope {grant.scope}, and this request needs {scope}")


def require_clutch(grant: Grant, clutch_id: str | None) -> None:
    """Raise ForbiddenError if the key is bound to other clutches; `clutch_id` is None if the request is about all
    clutches."""
    if grant.clutches is not None and clutch_id not in grant.clutches:
        subject = "all clutches" if clutch_id is None else f"clutch {clutch_id[:80]!r}"
        raise ForbiddenError(f"the key is for certain clutches only, and this request is about {subject}")


def _stamp(moment: datetime) -> str:
    return moment.isoformat(timespec="seconds")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _require_direct(request: Request) -> None:
    """Raise ForbiddenError if a request without a key comes through a proxy or from another machine."""
    proxy = "HTTP/1.0" if request.scope["http_version"] == _VERSION_OF_PROXIES else None
    for name, _ in request.scope["headers"]:
        if name in _OF_PROXIES or _FORWARDED in name or name.endswith(_CLIENT_IP):
            proxy = name.decode("latin-1").title()
    if proxy is not None:
        raise ForbiddenError(
            f"no key exists, so a request through a proxy ({proxy}) has no access: {_MAKE_ONE}, or serve with "
            "--insecure-local"
        )
    address = None if request.client is None else request.client.host
    if address is not None and not is_loopback(address):
        raise ForbiddenError(f"no key exists, so only this machine has access, not {address}: {_MAKE_ONE}")


def _require_own_host(request: Request) -> None:
    """Raise ForbiddenError if a request without a key names another host, or comes from another site's page."""
    host, origin = request.headers.get("host", "").strip(), request.headers.get("origin")
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    if not is_loopback(name):
        raise ForbiddenError(
            f"no key exists, so the service answers at localhost only, not at {host[:80]!r}: {_MAKE_ONE}"
        )
    if origin is not None and origin.partition("://")[2] != host:
        raise ForbiddenError(f"no key exists, so a page of {origin[:80]!r} has no access: {_MAKE_ONE}")


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
    context = request.app.state.context
    assert isinstance(context, Context)  # noqa: S101  (set when the service starts)
    return context


def allowed(scope: Scope, *, narrowed: bool = False) -> Callable[[Request], Awaitable[Context]]:
    """A FastAPI dependency: returns the service's context if `authorise` allows the request, else raises its error."""

    async def check(request: Request) -> Context:
        """The context, for a caller whose key has the scope for this route. Raises UnauthorizedError, ForbiddenError."""
        context, clutch_id = context_of(request), clutch_of(request)
        snapshot = getattr(request.state, "snapshot", None) or await snapshot_at(request, clutch_id)
        grant = authorise(request, snapshot, scope, clutch_id, narrowed=narrowed)
        _refuse_unknown_arguments(request)
        if grant.key_id is not None:
            context.key_uses.note(context.database, grant.key_id)
        return context

    return check


def clutch_of(request: Request) -> str | None:
    clutch_id: str | None = request.scope["path_params"].get("clutch_id")
    return clutch_id


def route_of(request: Request) -> str:
    """The request's name in logs and metrics: the template of its route, so that no clutch or run of its path is
    disclosed."""
    return getattr(request.scope.get("route"), "path", UNMATCHED)


def grant_of(request: Request) -> Grant:
    """The permissions of the sender of an authorised request."""
    grant: Grant = request.state.grant
    return grant


def _refuse_unknown_arguments(request: Request) -> None:
    """Raise InvalidError if the query has an argument that the route does not know, such as a misspelt one."""
    if not request.scope["query_string"]:
        return
    arguments = {field.alias for field in query_fields(request.scope["route"])}
    errors = [
        FieldError(
            pointer=f"/query/{name}",
            code="extra_forbidden",
            message=f"{name} is not an argument of this route; its arguments: {', '.join(sorted(arguments)) or 'none'}",
            value=value[:80],
        )
        for name, value in request.query_params.items()
        if name not in arguments
    ]
    if errors:
        raise InvalidError(errors[0].message, errors=errors)


def query_fields(route: Any) -> list[Any]:
    """All query parameters of a route, including those of its dependencies."""
    parts = [route.dependant]
    for part in parts:
        parts += part.dependencies
    return [field for part in parts for field in part.query_params]


Reader = Annotated[Context, Depends(allowed("read"))]
Ingester = Annotated[Context, Depends(allowed("ingest"))]
Admin = Annotated[Context, Depends(allowed("admin"))]
#: For routes that name no clutch in their path and keep to the caller's own themselves.
OwnReader = Annotated[Context, Depends(allowed("read", narrowed=True))]
OwnIngester = Annotated[Context, Depends(allowed("ingest", narrowed=True))]
OwnAdmin = Annotated[Context, Depends(allowed("admin", narrowed=True))]
