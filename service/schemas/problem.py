"""The shape of every error in the API's description (RFC 9457); `web.problems` makes them."""

from pydantic import Field

from service.schemas.base import Answer


class ProblemError(Answer):
    """One wrong place of a request."""

    pointer: str = Field(description="JSON pointer into the request; empty where no single place is wrong")
    row: int | None = Field(description="Row of the column, from 1; null where the place is not in a column")
    value: str = Field(description="The wrong value, shortened; empty where there is none")
    code: str = Field(description="The rule that is broken, in a word for programs")
    message: str = Field(description="The place, the rule and the value, in a sentence")


class Problem(Answer):
    """A problem report."""

    type: str = Field(description="The kind of problem: `urn:clutchlife:problem:` and its name")
    title: str = Field(description="The kind of problem in a few words")
    status: int = Field(description="The HTTP status")
    detail: str = Field(description="What is wrong in this request")
    errors: list[ProblemError] = Field(description="The wrong places, at most 50")
    total_errors: int = Field(description="How many places are wrong in all")
    request_id: str = Field(description="The answer's `X-Request-ID`, by which the service's log names the request")
