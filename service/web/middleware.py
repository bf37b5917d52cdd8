"""Handles what all requests share: ids, logs, limits per caller, compression, and headers."""

import hashlib
import math
import secrets
import time
import zlib
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from logging import DEBUG, INFO, WARNING
from typing import Any
from urllib.parse import urlsplit

from fastapi.concurrency import run_in_threadpool
from fastapi.dependencies.utils import request_params_to_args
from fastapi.responses import Response
from opentelemetry import propagate
from opentelemetry.trace import Span, SpanKind
from starlette.datastructures import Headers, MutableHeaders, QueryParams
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.answers.store import Again
from service.errors import BusyError, InvalidError, ServiceError, TooLargeError, TooManyError, UnsupportedMediaTypeError
from service.logging import access, log_request, request_id, sane
from service.tracing import tracer
from service.web import limits
from service.web.auth import UNMATCHED, authorise, clutch_of, context_of, query_fields, route_of, snapshot_at
from service.web.bodies import Room
from service.web.metrics import Metrics
from service.web.problems import refused, unexpected
from storage.engine.errors import StorageError


class _OfRequests(ABC):
    """Middleware whose `handle` gets HTTP requests; other ASGI events go straight to the application."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await (self.handle if scope["type"] == "http" else self.app)(scope, receive, send)

    @abstractmethod
    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""


class Shares(_OfRequests):
    """Limits each caller to a rate of requests a second and a number at once; excess requests get 429.

    A caller may save up two seconds of unused requests. A caller is a known key, else an address: all attempts with
    wrong keys count for the address. `/livez` and `/readyz` have no limit.
    """

    def __init__(self, app: ASGIApp, per_second: float, at_once: int) -> None:
        super().__init__(app)
        self.per_second = per_second
        self.at_once = at_once
        self._shares: OrderedDict[str, _Share] = OrderedDict()
        self._keys: OrderedDict[bytes, str] = OrderedDict()  # by the digest of what was sent as Authorization

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["path"] in limits.UNLIMITED:
            await self.app(scope, receive, send)
            return
        header = next((value for name, value in scope["headers"] if name == b"authorization"), None)
        sent = None if header is None else hashlib.sha256(header).digest()
        share = self._share_of(sent, scope.get("client"))
        if (wait := self._wait(share)) > 0:
            detail = f"one caller may send {self.per_second:g} requests a second and have {self.at_once} open at once"
            response = refused(TooManyError, detail)
            response.headers["Retry-After"] = str(math.ceil(wait))
            await response(scope, receive, send)
            return
        share.running += 1
        try:
            await self.app(scope, receive, send)
        finally:
            share.running -= 1
            grant = scope.get("state", {}).get("grant")
            if sent is not None and grant is not None and grant.key_id is not None:
                self._keys[sent] = f"key {grant.key_id}"
                if len(self._keys) > limits.MAX_CALLERS:
                    self._keys.popitem(last=False)

    def _share_of(self, sent: bytes | None, client: tuple[str, int] | None) -> "_Share":
        """The share of a caller, by its known key or else its address."""
        name = self._keys.get(sent or b"") or ("" if client is None else client[0])
        full = _Share(limits.SAVED_SECONDS * self.per_second, time.monotonic())
        share = self._shares.setdefault(name, full)
        self._shares.move_to_end(name)
        if len(self._shares) > limits.MAX_CALLERS:
            self._shares.popitem(last=False)
        return share

    def _wait(self, share: "_Share") -> float:
        """Seconds until the caller may send a request; 0 if it may now, which is then deducted from its share."""
        now = time.monotonic()
        saved = min(limits.SAVED_SECONDS * self.per_second, share.saved + (now - share.at) * self.per_second)
        share.saved, share.at = saved, now
        if share.running >= self.at_once:
            return limits.RETRY_AFTER_SECONDS
        if saved < 1:
            return (1 - saved) / self.per_second
        share.saved -= 1
        return 0


@dataclass(slots=True)
class _Share:
    """The requests that a caller has saved up at a moment [s], and its number of running requests."""

    saved: float
    at: float
    running: int = 0


class Heads(_OfRequests):
    """Answers HEAD wherever GET is answered, with the same status and headers but no body (RFC 9110, section 9.3.2)."""

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return

        async def without_body(message: Message) -> None:
            scope["method"] = "HEAD"  # the server must not wait for the body that the headers announce
            if message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        scope["method"] = "GET"
        try:
            await self.app(scope, receive, without_body)
        finally:
            scope["method"] = "HEAD"


_NEVER = "object-src 'none'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
#: Scripts, styles, images and all else are files of this service.
POLICY = f"default-src 'self'; script-src 'self'; {_NEVER}"
#: Unless a route says otherwise: nothing is sniffed or told to other hosts, and no page loads what POLICY does not allow.
_SAFE = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Content-Security-Policy": POLICY,
}
#: Asked again and again by machines: logged from `debug` on, like what is still as it was (304).
_PROBES = (*limits.UNLIMITED, "/metrics")


class Edge(_OfRequests):
    """Gives every request an id, security headers, a log line, and a count and duration under its route's template."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        super().__init__(app)
        self.metrics = metrics

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        sent = next((value for name, value in scope["headers"] if name == b"x-request-id"), b"")
        own_id = (sane(sent) if sent else None) or secrets.token_hex(8)
        request_id.set(own_id)
        caller = propagate.extract(Headers(scope=scope))
        with tracer.start_as_current_span(scope["method"], context=caller, kind=SpanKind.SERVER) as span:
            await self._answered(scope, receive, send, own_id, span)

    async def _answered(self, scope: Scope, receive: Receive, send: Send, own_id: str, span: Span) -> None:
        """Answer a request inside its span; its status, bytes and seconds are noted at the end."""
        status, size, started = 0, 0, time.perf_counter()

        async def noting(message: Message) -> None:
            """Send a message with the headers of all answers, and note status and bytes."""
            nonlocal status, size
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                safe = {name: headers.get(name, usual) for name, usual in _SAFE.items()}
                headers.update(safe | {"X-Request-ID": own_id})
            else:
                size += len(message.get("body", b""))
            await send(message)

        try:
            await self.app(scope, receive, noting)
            status = status or 499  # as below: the reader went before the answer began
        except ClientDisconnect:  # nobody is there to be answered
            status = 499  # as proxies log it
        except Exception as error:
            if status:  # too late to say so: the server logs it and ends the connection
                raise
            await unexpected(Request(scope), error)(scope, receive, noting)
        finally:
            self._note(scope, status or 500, size, time.perf_counter() - started, span)

    def _note(self, scope: Scope, status: int, size: int, seconds: float, span: Span) -> None:
        """Count, time and log an answered request under its route."""
        route = route_of(Request(scope))
        method = scope["method"] if route != UNMATCHED else "any"
        span.update_name(f"{method} {route}")
        span.set_attributes({"http.request.method": method, "http.route": route, "http.response.status_code": status})
        self.metrics.requests.labels(method, route, str(status)).inc()
        self.metrics.seconds.labels(method, route).observe(seconds)
        level = WARNING if status >= 500 else DEBUG if status == 304 or route in _PROBES else INFO
        if access.isEnabledFor(level):
            grant = scope.get("state", {}).get("grant")
            log_request(level, scope["method"], route, status, seconds, size, None if grant is None else grant.name)


_REMEMBERED = "clutchlife.poll"


def remember(request: Request, again: Again) -> None:
    """Have later requests for this address answered by `again`, without the route. Only for answers that the scope
    `read` may see."""
    request.scope[_REMEMBERED] = again


class Polls(_OfRequests):
    """Answers repeated GETs of recent addresses from the cache, once the caller's key is checked; the route is not
    called.

    An answer is found by its path and its arguments as they were checked: however a number is written, it is one entry.
    """

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app)
        self._places: OrderedDict[str, tuple[Any, str | None]] = OrderedDict()  # the route and the clutch of a path

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] != "GET":
            await self.app(scope, receive, send)
            return
        path, query = scope["path"], scope["query_string"]
        if path in self._places:
            route, clutch_id = self._places[path]
            again = context_of(Request(scope)).answers.again((path, _arguments(route, query)))
            if again is not None and (response := await _from_cache(route, clutch_id, again, scope)) is not None:
                await response(scope, receive, send)
                return
        await self.app(scope, receive, send)
        again = scope.get(_REMEMBERED)
        if again is not None:
            request = Request(scope)
            self._places[path] = scope["route"], clutch_of(request)
            while len(self._places) > limits.MAX_POLLED:
                self._places.popitem(last=False)
            asked = (path, _arguments(scope["route"], query))
            context_of(request).answers.remember(asked, again, limits.MAX_POLLED)


async def _from_cache(route: Any, clutch_id: str | None, again: Again, scope: Scope) -> Response | None:
    """The cached response for a caller who may read it; None if the route has to answer."""
    request = Request(scope)
    try:
        context = context_of(request)
        snapshot = await snapshot_at(request, clutch_id)
        grant = authorise(request, snapshot, "read", clutch_id)
        response = again(request)
    except (ServiceError, StorageError):  # the usual way says what is wrong
        return None
    if response is not None:
        scope["route"] = route  # by which requests are counted
        if grant.key_id is not None:
            context.key_uses.note(context.database, grant.key_id)
    return response


def _arguments(route: Any, query: bytes) -> Hashable:
    """A query's arguments as the route parses them; None if they are invalid (the route then reports the error)."""
    if not query:
        return ()
    sent, fields = QueryParams(query), query_fields(route)
    values, errors = request_params_to_args(fields, sent)
    if errors or not sent.keys() <= {field.alias for field in fields}:
        return None
    return tuple(values.values())


#: The end of an entity tag of packed bytes.
_PACKED = '-gzip"'
#: zlib's word for the format: gzip, with the largest window.
_GZIP = 16 + zlib.MAX_WBITS


def _unpacked(receive: Receive) -> Receive:
    """A `receive` that decompresses a gzip request body, piece by piece in a thread. Raises InvalidError if the body is
    no gzip, is cut off or goes on after its end, and TooLargeError if it unpacks to more than `limits.MAX_RATIO` times
    its bytes.
    """
    unpacker = zlib.decompressobj(_GZIP)
    packed, more, ended = b"", True, False
    taken = given = 0

    async def receive_unpacked() -> Message:
        """The next decompressed piece of the body; after its end, the messages that follow."""
        nonlocal packed, more, ended, taken, given
        while not ended:
            if not packed and more:
                message = await receive()
                if message["type"] != "http.request":
                    return message
                packed, more = message.get("body", b""), message.get("more_body", False)
            before = len(packed)
            try:
                piece = await run_in_threadpool(unpacker.decompress, packed, limits.PIECE_BYTES)
            except zlib.error as error:
                raise InvalidError(f"the body is not the gzip data that Content-Encoding announces: {error}") from error
            packed = unpacker.unconsumed_tail
            taken, given = taken + before - len(packed), given + len(piece)
            if unpacker.unused_data:
                raise InvalidError("the body has more bytes after the end of its gzip data")
            if given > limits.PIECE_BYTES and given > limits.MAX_RATIO * taken:
                raise TooLargeError(f"the body unpacks to more than {limits.MAX_RATIO} times its bytes: send it plain")
            ended = not piece and not packed and not more
            if ended and not unpacker.eof:
                raise InvalidError("the gzip data of the body is cut off")
            if piece or ended:
                return {"type": "http.request", "body": piece, "more_body": not ended}
        return await receive()

    return receive_unpacked


class Encodings(_OfRequests):
    """Compresses response bodies by gzip, unless they are already, and decompresses request bodies; any other encoding
    of a request gets 415.

    An entity tag names exact bytes, so the compressed response has the same tag with a mark.
    """

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app)
        self.packing = GZipMiddleware(app, limits.MIN_PACKED_BYTES, limits.PACKING_LEVEL)

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = MutableHeaders(scope=scope)
        encoding = headers.get("content-encoding", "identity").strip().lower()
        if encoding not in ("identity", "gzip"):
            detail = f"send the body plain or packed by gzip, not by {encoding[:80]!r}"
            response = refused(UnsupportedMediaTypeError, detail)
            response.headers["Accept-Encoding"] = "gzip"
            await response(scope, receive, send)
            return
        if encoding == "gzip":
            del headers["content-encoding"], headers["content-length"]
            receive = _unpacked(receive)
        wanted_tags = headers.get("if-none-match", "")
        if _PACKED in wanted_tags:
            headers["if-none-match"] = wanted_tags.replace(_PACKED, '"')

        async def tagged(message: Message) -> None:
            """Send a message; the entity tag of compressed bytes gets its mark."""
            if message["type"] == "http.response.start":
                answered = MutableHeaders(scope=message)
                tag = answered.get("etag", "").removesuffix('"') + _PACKED
                encoded = answered.get("content-encoding")
                if encoded == "identity":  # the answer's own word that it is not to be packed
                    del answered["content-encoding"]
                packed = encoded == "gzip"
                if "etag" in answered and (packed or (message["status"] == 304 and tag in wanted_tags)):
                    answered["etag"] = tag
            await send(message)

        await self.packing(scope, receive, tagged)


class Answers(_OfRequests):
    """Sends long responses in pieces, each once the client has read the one before. Responses being sent share a budget
    of memory; one that exceeds it is refused with 503.

    A cached response sent to several clients counts once.
    """

    def __init__(self, app: ASGIApp) -> None:
        super().__init__(app)
        self.room = Room(limits.MAX_ANSWERS_IN_MEMORY)

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        start: Message | None = None
        is_refused = False

        async def in_pieces(message: Message) -> None:
            """Send a message, a long body in pieces."""
            nonlocal start, is_refused
            if message["type"] == "http.response.start":
                start = message  # goes with the first bytes: until then the answer may become another
            elif not is_refused:
                content, more = message.get("body", b""), message.get("more_body", False)
                if len(content) <= limits.PIECE_BYTES:
                    await begin()
                    await send(message)
                    return
                with self.room.sharing(content) as has_room:
                    if start is not None and not has_room:
                        is_refused = True
                        await refused(
                            BusyError, "the answers of other requests use all available room: try again later"
                        )(scope, receive, send)
                        return
                    await begin()
                    view = memoryview(content)
                    for at in range(0, len(content), limits.PIECE_BYTES):
                        piece = bytes(view[at : at + limits.PIECE_BYTES])
                        goes_on = more or at + len(piece) < len(content)
                        await send({"type": "http.response.body", "body": piece, "more_body": goes_on})

        async def begin() -> None:
            nonlocal start
            if start is not None:
                begun, start = start, None
                await send(begun)

        await self.app(scope, receive, in_pieces)


class RootPath(_OfRequests):
    """Serves the application below a root path such as `/clutch` (or empty); the outermost middleware."""

    def __init__(self, app: ASGIApp, root: str) -> None:
        super().__init__(app)
        self.root = root

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        host = Headers(scope=scope).get("host", "")
        path = scope["path"]

        async def addressed(message: Message) -> None:
            """Send a message with addresses relative to this service and below its root path."""
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                if "location" in headers:
                    headers["location"] = self._below(_relative_address(headers["location"], host))
                if headers.get("link", "").startswith("<"):
                    headers["link"] = "<" + self._below(headers["link"].removeprefix("<"))
            await send(message)

        if self.root and path == self.root:  # relative addresses of a page need the slash
            await RedirectResponse("/", 308)(scope, receive, addressed)
            return
        if self.root and path.startswith(self.root + "/"):
            scope = {**scope, "path": path.removeprefix(self.root)}
        await self.app(scope, receive, addressed)

    def _below(self, address: str) -> str:
        return self.root + address if address.startswith("/") else address


def _relative_address(address: str, host: str) -> str:
    """An address of this service without scheme and host, which a proxy may have changed; other addresses unchanged."""
    parts = urlsplit(address)
    return parts._replace(scheme="", netloc="").geturl() if parts.netloc == host else address
