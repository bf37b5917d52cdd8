"""What a route is given: the database, the clock, and a caller who may ask."""

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Annotated

from fastapi import Depends, Query, Request

from models.prognosis.criteria import HORIZON
from service.errors import FieldError, InvalidError
from service.jobs.queue import Worker
from service.queries.views import Remembered
from service.web.auth import Caller, Scope, authorise
from service.web.metrics import Metrics
from storage.engine.database import Database

#: Bytes of encoded pages that are remembered, together.
MOST_PAGES = 64 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """The service's parts, made when it starts and closed when it stops: `remembered` are answers, `pages` their bytes."""

    database: Database
    remembered: Remembered
    pages: Remembered = field(default_factory=lambda: Remembered(most=MOST_PAGES))
    metrics: Metrics
    worker: Worker

    def now(self) -> str:
        """The time, UTC, ISO 8601."""
        return datetime.now(UTC).isoformat(timespec="milliseconds")


def context_of(request: Request) -> Context:
    """The running service's context."""
    found = request.app.state.context
    assert isinstance(found, Context)  # noqa: S101  (set when the service starts)
    return found


def caller_of(request: Request) -> Caller:
    """What the request says of its sender."""
    return Caller(
        authorization=request.headers.get("authorization"),
        address=None if request.client is None else request.client.host,
        host=request.headers.get("host"),
        origin=request.headers.get("origin"),
    )


def allowed(scope: Scope) -> Callable[[Request], Context]:
    """A dependency that gives the context to callers with that scope and stops the others."""

    def check(request: Request) -> Context:
        context = context_of(request)
        _refuse_unknown_arguments(request)
        authorise(context.database, caller_of(request), scope)
        return context

    return check


#: Tables and short lists are told whole, and take what a list may be asked.
_OF_LISTS = {"limit", "cursor"}


def _refuse_unknown_arguments(request: Request) -> None:
    """A mistyped argument must not be answered as if it had not been there."""
    route = request.scope["route"]
    known = {field.alias for field in route.dependant.query_params} | _OF_LISTS
    unknown = [name for name in request.query_params if name not in known]
    if unknown:
        errors = [
            FieldError(
                pointer=f"/query/{name}",
                code="extra_forbidden",
                message=f"{name} is no argument here; there are: {', '.join(sorted(known)) or 'none'}",
                value=request.query_params[name][:80],
            )
            for name in unknown
        ]
        raise InvalidError(errors[0].message, errors=errors)


Reader = Annotated[Context, Depends(allowed("read"))]
Ingester = Annotated[Context, Depends(allowed("ingest"))]

Limit = Annotated[int, Query(ge=1, le=1000, description="Items a page")]
Whole = Annotated[int, Query(ge=1, le=1_000_000, description="Items a page; left out, all of them")]
Cursor = Annotated[str | None, Query(max_length=600, description="Where an earlier page ended: its `next`")]
PressureBar = Annotated[
    float | None,
    Query(
        ge=0, le=1e4, allow_inf_nan=False, description="A pressure of the first stationary test; left out, their mean"
    ),
]
AtCycles = Annotated[
    float | None, Query(ge=0, le=HORIZON * 1e6, allow_inf_nan=False, description="As it would have been said then")
]
