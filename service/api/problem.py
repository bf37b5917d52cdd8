"""What is answered where a request is refused: a problem report after RFC 9457, and what may have been meant."""

from pydantic import Field

from service.api.base import Answer
from service.api.rig import Suggestion


class ProblemError(Answer):
    """One wrong place of a request."""

    pointer: str = Field(description="JSON pointer into the request; empty if no single place is wrong")
    row: int | None = Field(description="Row of the column, from 1; null if the place is not in a column")
    value: str = Field(description="The wrong value, shortened; may be empty")
    code: str = Field(description="The rule that is broken, in a word for programs")
    message: str = Field(description="The place, the rule and the value, in a sentence")


class Problem(Answer):
    """A problem report."""

    type: str = Field(description="The kind of problem: `urn:clutchlife:problem:` and its name")
    title: str = Field(description="The kind of problem in a few words")
    status: int = Field(description="The HTTP status")
    detail: str = Field(description="What is wrong in this request")
    errors: list[ProblemError] = Field(description="The wrong places, at most 50")
    total_errors: int = Field(description="Total number of wrong places")
    request_id: str = Field(description="The answer's `X-Request-ID`; the service's log names the request by it")
    suggestion: Suggestion | None = Field(
        default=None,
        description="Of a file that is not read without a question: how it may be read, for you to confirm",
    )
