"""The shape of every error (RFC 9457)."""

from service.schemas.base import Answer


class ProblemError(Answer):
    """One thing wrong: JSON pointer into the request, 1-based row where it is in a column."""

    pointer: str
    row: int | None
    value: str
    code: str
    message: str


class Problem(Answer):
    """A problem; `errors` holds at most 50, `total_errors` says how many there are."""

    type: str
    title: str
    status: int
    detail: str
    errors: list[ProblemError]
    total_errors: int
