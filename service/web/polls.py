"""What a page asks again and again is answered before anything else is looked at: its address, the caller, the revision.

A route that has answered leaves behind how the same answer is found again (`remember`). Where the same address is asked for
with the same arguments, and the answer of the revision as it is now is held, that is sent, or 304; in every other case, an
unknown caller or a changed clutch, the request takes its usual way.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fastapi import Request
from fastapi.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

from service.errors import ServiceError
from service.web.auth import authorise, caller_of, context_of
from service.web.limits import MOST_POLLED
from storage.engine.errors import StorageError

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
    """The middleware that does so, for the addresses that were asked for last."""

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
