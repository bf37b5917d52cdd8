"""Errors as `application/problem+json` (RFC 9457): the one place where what went wrong becomes HTTP."""

import errno
import http
import logging
from collections.abc import Mapping
from typing import Any, TypeAlias

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException

from service.answers.store import to_json
from service.api.base import rule_in_words
from service.api.problem import Problem, ProblemError
from service.api.rig import Suggestion
from service.errors import (
    ConflictError,
    DamagedError,
    FieldError,
    ForbiddenError,
    InvalidError,
    NoRoomError,
    NotFoundError,
    NotPossibleNowError,
    ServiceError,
    TooLargeError,
    TooManyError,
    TooSlowError,
    UnauthorizedError,
    UnsupportedMediaTypeError,
)
from service.logging import request_id
from service.web.auth import route_of
from service.web.limits import RETRY_AFTER_SECONDS
from storage.engine.errors import DamagedData, DatabaseBusy, RawStoreUnavailable, StorageError, UnstorableText

PROBLEM_TYPE = "application/problem+json"

#: The system's words for a full disk, a quota that is used up, and a file that grew too large.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

_log = logging.getLogger("clutchlife")


def problem(
    status: int,
    slug: str,
    title: str,
    detail: str,
    errors: tuple[FieldError, ...] = (),
    total: int = 0,
    suggestion: Suggestion | None = None,
) -> Response:
    """An error response as RFC 9457 has it, with the headers that its status needs."""
    body = Problem(
        type=f"urn:clutchlife:problem:{slug}",
        title=title,
        status=status,
        detail=detail,
        errors=[_shown(error) for error in errors],
        total_errors=total,
        request_id=request_id.get(),
        suggestion=suggestion,
    )
    headers = {"Cache-Control": "no-store"}
    if status in (http.HTTPStatus.SERVICE_UNAVAILABLE, http.HTTPStatus.TOO_MANY_REQUESTS):
        headers["Retry-After"] = str(RETRY_AFTER_SECONDS)
    if status == http.HTTPStatus.UNAUTHORIZED:
        headers["WWW-Authenticate"] = "Bearer"
    if status in (http.HTTPStatus.REQUEST_TIMEOUT, http.HTTPStatus.REQUEST_ENTITY_TOO_LARGE):
        headers["Connection"] = "close"  # what is left of the body would be read as the next request
    return Response(content=to_json(body), status_code=status, media_type=PROBLEM_TYPE, headers=headers)


def refused(kind: type[ServiceError], detail: str) -> Response:
    return problem(kind.status, kind.slug, kind.title, detail)


def _shown(error: FieldError) -> ProblemError:
    """An error of one field, in printable characters."""
    return ProblemError(
        pointer=error.pointer,
        row=error.row,
        value=_printable(error.value),
        code=error.code,
        message=_printable(error.message),
    )


def _printable(text: str) -> str:
    return text.encode("utf-8", "backslashreplace").decode()


def install(app: FastAPI) -> None:
    """Map every error of the service to its problem response."""
    app.exception_handler(ServiceError)(_service_error)
    app.exception_handler(StorageError)(_storage_error)
    app.exception_handler(RequestValidationError)(_request_error)
    app.exception_handler(HTTPException)(_http_error)
    app.exception_handler(OSError)(_system_error)


def _service_error(_: Request, error: ServiceError) -> Response:
    held = error.suggestion if isinstance(error, InvalidError) else None
    suggestion = held if isinstance(held, Suggestion) else None
    return problem(
        error.status, error.slug, error.title, _printable(error.detail), error.errors, error.total, suggestion
    )


def _storage_error(_: Request, error: StorageError) -> Response:
    """The response to an error of the database or of the store of raw records."""
    if isinstance(error, UnstorableText):
        return refused(InvalidError, str(error))
    _log.error("storage: %s", error)
    if isinstance(error, RawStoreUnavailable):
        return problem(503, "raw-records", "The store of raw records cannot be used", f"{error}. Nothing was changed")
    if isinstance(error, DamagedData):
        detail = (
            f"{error}. On the service's machine, `clutchlife verify` lists damage and `clutchlife replay` mends results"
        )
        return refused(DamagedError, detail)
    slug, title = ("busy", "Busy") if isinstance(error, DatabaseBusy) else ("storage", "The database cannot be used")
    return problem(503, slug, title, "nothing was changed: send the request again, or see the service's log")


def _request_error(request: Request, error: RequestValidationError) -> Response:
    errors = [_argument_error(details) for details in error.errors()]
    more = f"; {len(errors)} errors in all" if len(errors) > 1 else ""
    return _service_error(request, InvalidError(errors[0].message + more, errors=errors))


def _argument_error(details: Mapping[str, Any]) -> FieldError:
    """pydantic's error of one argument as a FieldError."""
    name = ".".join(str(part) for part in details["loc"][1:])
    shown = repr(details.get("input"))[:80]
    return FieldError(
        pointer="/" + "/".join(str(part) for part in details["loc"]),
        code=details["type"],
        message=f"{name}: {rule_in_words(details['type'], details['msg'])}, got {shown}",
        value=shown,
    )


def _http_error(_: Request, error: HTTPException) -> Response:
    title = http.HTTPStatus(error.status_code).phrase
    response = problem(error.status_code, title.lower().replace(" ", "-"), title, str(error.detail))
    response.headers.update(error.headers or {})
    return response


def _system_error(request: Request, error: OSError) -> Response:
    if error.errno not in _NO_ROOM:
        return unexpected(request, error)
    _log.error("%s %s: %s", request.method, route_of(request), error)
    reason = f"the service's disk has no room for the file ({error.strerror})"
    return refused(NoRoomError, f"{reason}. Nothing was stored: make room and send it again")


def unexpected(request: Request, error: Exception) -> Response:
    """The response to a program error: the log has the details, the response has none."""
    _log.error("%s %s", request.method, route_of(request), exc_info=error)
    return refused(ServiceError, "the service's log describes this error")


#: The schema of all problems, made once: sixty answers of routes refer to it.
_PROBLEM = Problem.model_json_schema()
#: The answers of a route by their status, as FastAPI takes them for the API's description.
Described: TypeAlias = dict[int | str, dict[str, Any]]


def described(*kinds: type[ServiceError]) -> Described:
    """The OpenAPI responses for these problems and for those common to all addresses."""
    always: list[type[ServiceError]] = [UnauthorizedError, ForbiddenError, InvalidError, TooManyError]
    answers: Described = {kind.status: _described(kind.title) for kind in [*always, *kinds]}
    answers[503] = _described("Busy, or the database cannot be used; try again after Retry-After")
    return answers


def _described(title: str) -> dict[str, object]:
    return {"description": title, "content": {PROBLEM_TYPE: {"schema": _PROBLEM}}}


READING = described(NotFoundError)
_OF_BODIES = (TooLargeError, TooSlowError, UnsupportedMediaTypeError)
CHANGING = described(NotFoundError, NotPossibleNowError, *_OF_BODIES)
SENDING = described(NotFoundError, ConflictError, *_OF_BODIES)
