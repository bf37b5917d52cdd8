"""What stands before every address: counts, a bound on the body, headers that browsers heed, and what polls ask again.

A page asks the same again and again. A route that has answered leaves behind how its answer is found again (`remember`):
where the same address is asked for with the same arguments, and the answer of the revision as it is now is held, that is
sent, or 304; in every other case, an unknown caller or a changed clutch, the request takes its usual way.
"""

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.errors import ServiceError, TooLargeError
from service.web.auth import authorise, caller_of, context_of
from service.web.limits import MOST_POLLED
from service.web.metrics import Metrics
from service.web.problems import problem
from storage.engine.errors import StorageError


class BodyLimit:
    """Refuses a body over `most` bytes (a file over `most_file`) with 413, announced or grown so far."""

    def __init__(self, app: ASGIApp, most: int, most_file: int) -> None:
        self.app = app
        self.most = most
        self.most_file = most_file

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        most = self.most_file if scope["path"].endswith("/runs/file") else self.most
        announced = dict(scope["headers"]).get(b"content-length", b"0")
        if announced.isdigit() and int(announced) > most:
            await self._refuse(most, scope, receive, send)
            return
        taken = 0

        async def counted() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > most:
                raise TooLargeError(_detail(most))
            return message

        await self.app(scope, counted, send)

    async def _refuse(self, most: int, scope: Scope, receive: Receive, send: Send) -> None:
        response = problem(TooLargeError.status, TooLargeError.slug, TooLargeError.title, _detail(most))
        response.headers["Connection"] = "close"
        await response(scope, receive, send)


def _detail(most: int) -> str:
    return f"a request may hold at most {most} bytes here"


class Heads:
    """HEAD is answered wherever GET is: the same status and headers, and no body (RFC 9110, section 9.3.2)."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD":
            await self.app(scope, receive, send)
            return

        async def without_body(message: Message) -> None:
            scope["method"] = "HEAD"  # the server must not wait for the body that the headers announce
            if message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        scope["method"] = "GET"
        await self.app(scope, receive, without_body)


class SafeHeaders:
    """Nothing is sniffed, framed or told to other hosts; pages may load from this host only.

    No script runs that is not a file of this service; the API's description alone starts from an inline one. The
    plotting library sets inline styles, saves a chart by way of `blob:` and draws icons from `data:`.
    """

    _base = (
        "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; object-src 'none'; "
        "frame-ancestors 'none'; base-uri 'none'; form-action 'none'; "
    )
    policy = _base + "script-src 'self'"
    policy_of_description = _base + "script-src 'self' 'unsafe-inline'"

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        described = scope["type"] == "http" and scope["path"].startswith("/docs")
        policy = self.policy_of_description if described else self.policy

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers["Content-Security-Policy"] = policy
            await send(message)

        await self.app(scope, receive, with_headers)


class Counting:
    """Counts and times every request by its route's template, so that names of clutches do not become labels."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        status, started = 500, time.perf_counter()

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
            await send(message)

        try:
            await self.app(scope, receive, noting)
        finally:
            route = getattr(scope.get("route"), "path", "unmatched")
            method = scope["method"] if route != "unmatched" else "any"
            self.metrics.requests.labels(method, route, str(status)).inc()
            self.metrics.seconds.labels(method, route).observe(time.perf_counter() - started)


_REMEMBERED = "clutchlife.poll"

#: The held answer as a response to a request, None where there is none for the present revision.
Again = Callable[[Request], Response | None]


def remember(request: Request, again: Again) -> None:
    """Answer the same address by `again` from now on. Only for what needs no more than the scope `read`."""
    request.scope[_REMEMBERED] = again


@dataclass(frozen=True, slots=True)
class _Poll:
    route: Any
    again: Again


class Polls:
    """Answers what was asked before without looking at anything else, for the addresses that were asked for last."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app
        self._polls: OrderedDict[tuple[str, bytes], _Poll] = OrderedDict()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "GET":
            await self.app(scope, receive, send)
            return
        address = (scope["path"], scope["query_string"])
        poll = self._polls.get(address)
        response = None if poll is None else self._answered(poll, scope)
        if response is not None:
            await response(scope, receive, send)
            return
        await self.app(scope, receive, send)
        again = scope.get(_REMEMBERED)
        if again is not None:
            self._polls[address] = _Poll(scope["route"], again)
            while len(self._polls) > MOST_POLLED:
                self._polls.popitem(last=False)

    def _answered(self, poll: _Poll, scope: Scope) -> Response | None:
        request = Request(scope)
        try:
            authorise(context_of(request).database.watch, caller_of(request), "read")
            response = poll.again(request)
        except (ServiceError, StorageError):  # the usual way says what is wrong
            return None
        if response is not None:
            scope["route"] = poll.route  # by which requests are counted
        return response
