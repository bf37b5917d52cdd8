"""What all schemas share: bases that refuse unknown fields, numbers that are finite, and fields that many answers have."""

from typing import Annotated, Any, Literal

from pydantic import (
    AwareDatetime,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    StringConstraints,
    WithJsonSchema,
)

from service.columns import whole
from service.schemas.limits import (
    EARLIEST_START,
    IDENTIFIER_PATTERN,
    LARGEST_NUMBER,
    LATEST_START,
    LONGEST_REASON,
    MOST_CYCLES,
)


class Schema(BaseModel):
    """Base of request bodies: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Answer(BaseModel):
    """Base of answers, for the API's description."""

    model_config = ConfigDict(extra="forbid")


# --- in requests ---

Identifier = Annotated[str, StringConstraints(pattern=IDENTIFIER_PATTERN)]

Cycles = Annotated[float, Field(ge=0, le=MOST_CYCLES, allow_inf_nan=False, strict=True), PlainSerializer(whole)]

PositiveNumber = Annotated[float, Field(gt=0, le=LARGEST_NUMBER, allow_inf_nan=False, strict=True)]
NotNegativeNumber = Annotated[float, Field(ge=0, le=LARGEST_NUMBER, allow_inf_nan=False, strict=True)]
#: 2.0 is the whole number 2.
WholeNumber = Annotated[
    int, Field(strict=True), BeforeValidator(lambda sent: whole(sent) if isinstance(sent, float) else sent)
]

#: ISO 8601 with a time zone.
StartedAt = Annotated[AwareDatetime, Field(ge=EARLIEST_START, le=LATEST_START)]

#: A column is checked by `service.columns`, which names row and value among millions.
Column = Annotated[
    list[Any],
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 1}),
]

Origin = Annotated[Literal["measured", "simulated"], Field(description="Whether a rig measured it or it is simulated")]

#: Why something is changed.
Reason = Annotated[str, StringConstraints(max_length=LONGEST_REASON, strip_whitespace=True)]

# --- in answers ---

ClutchName = Annotated[str, Field(description="The clutch's name")]
RunName = Annotated[str, Field(description="The run's name")]
RunCycles = Annotated[float, Field(description="Duty cycles since new when the run was made")]
Revision = Annotated[int, Field(description="Increases with every change of the clutch's results")]
Next = Annotated[str | None, Field(description="The `cursor` of the next page; null on the last one")]
