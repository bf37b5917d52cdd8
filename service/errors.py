"""What can go wrong for a caller: one base, mapped to HTTP once (`service.web.problems`). Knows no web framework."""

from collections.abc import Sequence
from dataclasses import dataclass

#: No answer lists more single errors than this; the total is always told.
MOST_ERRORS = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldError:
    """One thing wrong with one place of a request: JSON pointer, 1-based row where the place is in a column, value."""

    pointer: str
    code: str
    message: str
    row: int | None = None
    value: str = ""


class ServiceError(Exception):
    """Base of everything a caller may be told. `slug` names the kind of problem, `status` is its HTTP status."""

    status = 500
    slug = "internal-error"
    title = "Something went wrong here"

    def __init__(self, detail: str, *, errors: Sequence[FieldError] = (), total: int | None = None) -> None:
        super().__init__(detail)
        self.detail = detail
        self.errors = tuple(errors[:MOST_ERRORS])
        self.total = len(errors) if total is None else total


class InvalidError(ServiceError):
    """The request is understood and its content is wrong."""

    status = 422
    slug = "invalid-content"
    title = "The content is not valid"


class NotFoundError(ServiceError):
    """Nothing is known under that name."""

    status = 404
    slug = "not-found"
    title = "Not found"


class ConflictError(ServiceError):
    """Other content is already known under that name."""

    status = 409
    slug = "conflict"
    title = "Other content is known under this name"


class NothingToAdoptError(ConflictError):
    """A diagnosis has no extension that could be adopted, or is of another life."""

    slug = "nothing-to-adopt"
    title = "There is nothing to adopt"


class TooLargeError(ServiceError):
    """The request is larger than the service takes."""

    status = 413
    slug = "too-large"
    title = "The request is too large"


class UnsupportedMediaTypeError(ServiceError):
    """The body is not of a type that this address takes."""

    status = 415
    slug = "unsupported-media-type"
    title = "The body has a type that is not taken here"


class BusyError(ServiceError):
    """So much is waiting already that this is not taken now; the same again may be, a little later."""

    status = 503
    slug = "busy"
    title = "Busy"


class UnauthorizedError(ServiceError):
    """A key is needed and none that is known was sent."""

    status = 401
    slug = "unauthorized"
    title = "A valid key is needed"


class ForbiddenError(ServiceError):
    """The caller is known, or is where it may not be, and may not do this."""

    status = 403
    slug = "forbidden"
    title = "Not allowed"
