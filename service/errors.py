"""The errors that a caller may get: one base, mapped to HTTP once (`service.web.problems`); and notices."""

import signal
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TypeVar

#: Errors that one answer lists; chosen: a screenful. The total is always stated.
MAX_ERRORS = 50
#: Characters of a wrong value that a message quotes; chosen: a line of a terminal.
MAX_QUOTED = 80


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldError:
    """One error at one place of a request: JSON pointer, value, and 1-based row if the place is in a column."""

    pointer: str
    code: str
    message: str
    row: int | None = None
    value: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """One cause of several held runs: its name and kind, the runs, and the correction of their cycles that it proposes, an
    offset or a factor (None: neither)."""

    name: str
    kind: str
    runs: tuple[str, ...]
    cycles_offset: float | None = None
    cycles_factor: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """A warning that did not stop the run; a doubt has the cycles that it concerns, and one about several runs their
    common cause."""

    code: str
    message: str
    likely_cycles: float | None = None
    hypothesis: Hypothesis | None = None


class ServiceError(Exception):
    """Base of all errors that a caller may get. `slug` names the kind of problem, `status` is its HTTP status."""

    status = 500
    slug = "internal-error"
    title = "An error inside the service"

    def __init_subclass__(cls, *, slug: str, title: str, status: int | None = None) -> None:
        cls.slug, cls.title, cls.status = slug, title, cls.status if status is None else status

    def __init__(self, detail: str, *, errors: Sequence[FieldError] = (), total: int | None = None) -> None:
        super().__init__(detail)
        self.detail = detail
        self.errors = tuple(errors[:MAX_ERRORS])
        self.total = len(errors) if total is None else total


class InvalidError(ServiceError, status=422, slug="invalid-content", title="The content is not valid"):
    """The request is understood and its content is wrong. `suggestion`: of a file that is not read without a question, what
    may be meant."""

    suggestion: object = None

    @classmethod
    def of(
        cls, message: str, *, code: str, pointer: str = "", value: str = "", row: int | None = None
    ) -> "InvalidError":
        """An error with one wrong place."""
        error = FieldError(pointer=pointer, code=code, message=message, row=row, value=value[:MAX_QUOTED])
        return cls(message, errors=[error])


class NotFoundError(ServiceError, status=404, slug="not-found", title="Not found"):
    """There is no object with this name."""


Found = TypeVar("Found")


def found(row: Found | None, what: str, name: str, *, only: Collection[str] | None = None) -> Found:
    """The row, if it was found and belongs to one of the clutches `only`. Raises NotFoundError where there is none, or
    it is of no clutch among `only` these."""
    if row is None or (only is not None and getattr(row, "clutch_id", None) not in only):
        raise NotFoundError(f"there is no {what} {name[:80]!r}")
    return row


def unknown_clutch(clutch_id: str) -> NotFoundError:
    """The error for a clutch that is not registered."""
    return NotFoundError(
        f"there is no clutch {clutch_id!r}: register it with POST /v1/clutches, or clutchlife register {clutch_id}"
    )


class ConflictError(ServiceError, status=409, slug="conflict", title="The name already has other content"):
    """An object of that name exists and has other content."""


class ArchivedError(ConflictError, slug="archived", title="The clutch is archived"):
    """The clutch is archived: it takes no more runs."""


class LifeEndedError(ConflictError, slug="life-ended", title="The life has ended"):
    """The life was declared ended: later duty and tests are refused, and so is another end."""


class NotPossibleNowError(ConflictError, slug="not-possible-now", title="This is not possible now"):
    """The request does not fit the present state of the object."""


class NothingToAdoptError(ConflictError, slug="nothing-to-adopt", title="There is nothing to adopt"):
    """A diagnosis has no extension that could be adopted, or is of another life."""


class TooLargeError(ServiceError, status=413, slug="too-large", title="The request is too large"):
    """The request is larger than the service accepts."""


class NoRoomError(ServiceError, status=507, slug="no-room", title="There is no room on the disk"):
    """The disk has no room for the data. Make room, then repeat the request."""


class UnsupportedMediaTypeError(
    ServiceError, status=415, slug="unsupported-media-type", title="This type of body is not accepted here"
):
    """The body is not of a type that this address accepts."""


class NotAcceptableError(ServiceError, status=406, slug="not-acceptable", title="This format is not available here"):
    """The answer is not available in the requested format."""


class TooSlowError(ServiceError, status=408, slug="too-slow", title="The request took too long to arrive"):
    """The request's body took too long to arrive."""


class TooManyError(ServiceError, status=429, slug="too-many-requests", title="Too many requests"):
    """The caller sends too many requests per second or at the same time."""


class BusyError(ServiceError, status=503, slug="busy", title="Busy"):
    """Too many requests of this kind wait. Repeat the request later."""


class DamagedError(ServiceError, status=503, slug="damaged", title="What is stored is damaged"):
    """A stored value fails its checksum. Results are mended by `clutchlife replay`, what was sent by a backup."""


class UnauthorizedError(ServiceError, status=401, slug="unauthorized", title="A valid key is needed"):
    """A key is needed and no valid one was sent."""


class ForbiddenError(ServiceError, status=403, slug="forbidden", title="Not allowed"):
    """The caller's key, or its address where no key exists, does not allow this."""


def exit_text(code: int) -> str:
    """A process's end in words, by the return code of `subprocess`: its signal or exit status."""
    try:
        return signal.Signals(-code).name if code < 0 else f"status {code}"
    except ValueError:
        return f"signal {-code}"
