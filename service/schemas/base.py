"""What all schemas share: bases that refuse unknown fields, numbers that are finite, fields that many answers have, and the
shape of every error (RFC 9457), which `web.problems` makes.
"""

from typing import Annotated, Any, Literal

from pydantic import (
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    StringConstraints,
    WithJsonSchema,
    create_model,
)

from service.columns import whole
from service.schemas import limits


class Schema(BaseModel):
    """Base of request bodies: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Answer(BaseModel):
    """Base of answers, for the API's description."""

    model_config = ConfigDict(extra="forbid")


# --- in requests ---

Identifier = Annotated[str, StringConstraints(pattern=limits.IDENTIFIER_PATTERN)]

Cycles = Annotated[float, Field(ge=0, le=limits.MAX_CYCLES, allow_inf_nan=False, strict=True), PlainSerializer(whole)]

PositiveNumber = Annotated[float, Field(gt=0, le=limits.LARGEST_NUMBER, allow_inf_nan=False, strict=True)]
NotNegativeNumber = Annotated[float, Field(ge=0, le=limits.LARGEST_NUMBER, allow_inf_nan=False, strict=True)]

#: ISO 8601 with a time zone.
StartedAt = Annotated[AwareDatetime, Field(ge=limits.EARLIEST_START, le=limits.LATEST_START)]

#: A column is checked by `service.columns`, which names row and value among millions.
Column = Annotated[
    list[Any],
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 1}),
]

Origin = Annotated[Literal["measured", "simulated"], Field(description="Whether a rig measured it or it is simulated")]

#: Why something is changed.
Reason = Annotated[str, StringConstraints(max_length=limits.LONGEST_REASON, strip_whitespace=True)]

# --- in answers ---

ClutchName = Annotated[str, Field(description="The clutch's name")]
RunName = Annotated[str, Field(description="The run's name")]
RunCycles = Annotated[float, Field(description="Duty cycles since new when the run was made")]
Revision = Annotated[int, Field(description="Increases with every change of the clutch's results")]
Next = Annotated[str | None, Field(description="The `cursor` of the next page; null on the last one")]


def of_row(schema: type[BaseModel], row: object, **own: Any) -> dict[str, Any]:
    """A stored row as the schema has it, field by field; `own` are those that the row calls otherwise or has not."""
    return {name: own[name] if name in own else getattr(row, name) for name in schema.model_fields}


def page_of(name: str, item: type[BaseModel], says: str, items: str) -> type[Answer]:
    """The schema of a list that is answered a page at a time; `says` and `items` describe it and its items."""
    fields: Any = {"items": (list[item], Field(description=items)), "next": (Next, ...)}  # type: ignore[valid-type]
    return create_model(name, __base__=Answer, __doc__=says, **fields)


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
