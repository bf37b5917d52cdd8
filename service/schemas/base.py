"""What all schemas share: nothing unknown is taken, numbers are numbers, names are safe in an address."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, PlainSerializer, StringConstraints, WithJsonSchema

IDENTIFIER_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}$"

Identifier = Annotated[str, StringConstraints(pattern=IDENTIFIER_PATTERN)]


def whole(value: float) -> float | int:
    """A float as JSON's shortest number: 7000.0 leaves as 7000."""
    return int(value) if value.is_integer() and abs(value) < 2**53 else value


Cycles = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False, strict=True), PlainSerializer(whole)]

PositiveNumber = Annotated[float, Field(gt=0, le=1e12, allow_inf_nan=False, strict=True)]
NotNegativeNumber = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False, strict=True)]

#: A column is checked by `service.readers.checks`, which can say row and value for millions of them.
Column = Annotated[
    list[Any],
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 1}),
]

Origin = Literal["measured", "simulated"]


class Schema(BaseModel):
    """Base of what comes in: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Answer(BaseModel):
    """Base of what goes out, for the API's description."""

    model_config = ConfigDict(extra="forbid")
