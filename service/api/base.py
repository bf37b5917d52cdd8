"""What all models of the API share: limits of values, bases that refuse unknown fields, common fields, the shape of errors.

The limits refuse mistyped values and overflow, not unusual clutches. Errors follow RFC 9457; `web.problems` makes them.
"""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializeAsAny,
    StringConstraints,
    ValidationInfo,
    WithJsonSchema,
    WrapValidator,
)

from service.channels import whole

#: Duty cycles since new, or in one block.
MAX_CYCLES = 1e12
#: Any other positive number of a request (energy in kJ, speed in rpm, duration in s, pressure in bar, viscosity in cSt).
LARGEST_NUMBER = 1e12

#: When a run may have been started. Other years are a clock's or a program's sign for "not set", as year 1 is.
EARLIEST_START, LATEST_START = datetime(1900, 1, 1, tzinfo=UTC), datetime(9998, 12, 31, tzinfo=UTC)

#: Diameters and radii of the disc, mm.
MIN_LENGTH_MM, MAX_LENGTH_MM = 0.1, 1e5
#: Outer less inner diameter, mm: a narrower ring is mistyped.
MIN_WIDTH_MM = 0.1
#: Friction faces of one clutch.
MAX_FRICTION_FACES = 1000
#: Lining pressure divided by line pressure.
MIN_PRESSURE_FACTOR, MAX_PRESSURE_FACTOR = 1e-6, 1e6
#: Time constant of the torque channel's own low-pass, ms: a slower one would hide the swing of a dynamic test (0.1 Hz).
MAX_TORQUE_FILTER_MS = 1000
#: Exponent of the severity of a duty cycle.
MAX_SEVERITY_EXPONENT = 10

#: Characters of a material's or fluid's name, a maintenance note, the reason of a change, a diagnosis' name, a file's name
#: and a map of channels.
LONGEST_NAME = 200
LONGEST_NOTE = 4000
LONGEST_REASON = 500
LONGEST_DIAGNOSIS_ID = 64
LONGEST_FILENAME = 255
LONGEST_MAP = 4000
#: A clutch's or a run's name: safe in an address and as a file's name, 128 characters at most.
LONGEST_IDENTIFIER = 128
IDENTIFIER_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}$"
#: Text that stands in one line: without control characters, breaks of lines and marks that turn the direction of writing, by
#: which a name could write over the line that a terminal, a log or a message shows it in.
LINE_PATTERN = r"^[^\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]*$"
#: Characters of a number in an address. Derived: the longest that a 64-bit float is written in has 24.
LONGEST_NUMBER = 32
#: Quotation marks and opening brackets of a JSON body. Derived: those of a note that consists of them, and as many again.
MAX_MARKS = 10_000
#: Samples of a channel that a plot may ask for: more than any screen has pixels; all samples need no argument.
MAX_POINTS = 1_000_000
#: Held runs that are confirmed in one step. As many as a page lists.
MAX_CONFIRMED = 1000
#: The limits of a criterion: its number of either sign, its place, and how many a clutch may have. Chosen: beyond any rig.
LARGEST_LIMIT, MAX_CRITERION_PRESSURE_BAR, MAX_SPEED_RPM, MAX_CRITERIA = 1e9, 1e4, 1e6, 8
#: The skewness of a surface profile, of either sign. Derived: of n heights it is at most √n, and no profile has 1e8 of them.
LARGEST_SKEWNESS = 1e4
#: Bytes of a photograph, and photographs of one inspection. Chosen: twice what a camera of 24 megapixels writes as JPEG; a
#: place on each of eight radii of both sides of three discs.
MAX_PHOTOGRAPH_BYTES, MAX_PHOTOGRAPHS = 16 << 20, 48
#: Rules of alarms of one clutch, and rules of several. Chosen: beyond what anybody reads, and a run asks each of them.
MAX_RULES = 100
#: Joint draws of a track's coefficients: beyond what the sample behind it holds they would repeat.
MAX_DRAWS = 1_000
#: Blocks of a programme of planned duty.
MAX_BLOCKS = 1000
#: The fewest cycles of a planned block, and its least energy a cycle, kJ: less is mistyped.
MIN_BLOCK_CYCLES, MIN_PLANNED_KJ = 1, 1e-6
#: Characters that a list is searched for, and items that it may pass over.
LONGEST_SEARCH, MAX_OFFSET = 200, 10_000_000
#: Characters of a column's title in a rig profile, columns of one, lines above its table, and words that stand for a kind of
#: run. Derived: what the readers take as a title, and as many columns as they read; chosen: more than any rig has.
LONGEST_TITLE, MAX_COLUMNS, MAX_SKIPPED, MAX_WORDS = 1000, 1000, 10_000, 20
#: Characters of a receiver's address and of the secret that signs what it is sent. Chosen: a query of tokens fits, and what
#: is shorter can be guessed.
LONGEST_ADDRESS, SHORTEST_SECRET, LONGEST_SECRET = 2000, 8, 200


#: What pydantic calls kinds of values, in a user's words.
_KINDS_OF_VALUES = (
    ("a valid integer", "a whole number"),
    ("a valid dictionary or instance of", "an object, as"),
    ("a valid dictionary", "an object"),
    ("a valid boolean", "true or false"),
    ("a valid ", "a "),
)


def rule_in_words(kind: str, message: str) -> str:
    """The rule that a value breaks, in plain words, from pydantic's kind of error and message."""
    if kind == "extra_forbidden":
        return "no such field"
    if kind in ("missing", "union_tag_not_found"):
        return "must be given"
    if kind == "union_tag_invalid":
        return f"must be one of {message.partition('expected tags: ')[2]}"
    if IDENTIFIER_PATTERN in message:
        return f"must have letters, digits and . _ : @ + - only, {LONGEST_IDENTIFIER} at most, a letter or digit first"
    rule = re.sub(r"^\w+ should ", "must ", message.removeprefix("Value error, "))
    for technical, plain in _KINDS_OF_VALUES:
        rule = rule.replace(technical, plain)
    return rule


Item = TypeVar("Item")
Row = TypeVar("Row", bound=BaseModel)


class Schema(BaseModel):
    """Base of request bodies: unknown fields are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Answer(BaseModel):
    """Base of answers: a value that goes out as JSON in the order of its fields, without those that were not given."""

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants")


# --- in requests ---

Identifier = Annotated[str, StringConstraints(pattern=IDENTIFIER_PATTERN)]


def _one_line(text: str, info: ValidationInfo) -> str:
    """The text; a request must send it as one line, while stored texts with several lines stay readable."""
    if info.mode == "json" and not re.fullmatch(LINE_PATTERN, text):
        raise ValueError("must be one line of text without control characters")
    return text


#: A name for people, and one that must be given.
Title = Annotated[
    str,
    StringConstraints(max_length=LONGEST_NAME),
    AfterValidator(_one_line),
    Field(json_schema_extra={"pattern": LINE_PATTERN}),
]
Name = Annotated[Title, StringConstraints(min_length=1)]

Cycles = Annotated[float, Field(ge=0, le=MAX_CYCLES, allow_inf_nan=False, strict=True), PlainSerializer(whole)]

PositiveNumber = Annotated[float, Field(gt=0, le=LARGEST_NUMBER, allow_inf_nan=False, strict=True)]
NotNegativeNumber = Annotated[float, Field(ge=0, le=LARGEST_NUMBER, allow_inf_nan=False, strict=True)]

#: ISO 8601 with a time zone.
StartedAt = Annotated[AwareDatetime, Field(ge=EARLIEST_START, le=LATEST_START)]

#: A column is checked by `service.channels`, which names row and value among millions.
Column = Annotated[list[Any], WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 1})]

Origin = Annotated[Literal["measured", "simulated"], Field(description="Whether a rig measured it or it is simulated")]

#: The states of a clutch after NAMUR NE 107, and the verdicts of a diagnosis.
StateName = Literal["failure", "maintenance", "check", "out_of_specification", "normal"]
VerdictName = Literal["model_adequate", "cause_named", "cause_ambiguous", "unexplained_structure", "insufficient_data"]

#: Why something is changed.
Reason = Annotated[str, StringConstraints(max_length=LONGEST_REASON, strip_whitespace=True)]

# --- in answers ---


def _as_computed(number: float, checked: Callable[[float], float]) -> float:
    """The checked number; an integer stays an integer."""
    as_float = checked(number)
    return number if type(number) is int else as_float


#: A number of an answer; whole ones that were computed as such are written without a decimal point.
Real = Annotated[float, WrapValidator(_as_computed), SerializeAsAny(), WithJsonSchema({"type": "number"})]
ClutchName = Annotated[str, Field(description="The clutch's name")]
RunName = Annotated[str, Field(description="The run's name")]
RunCycles = Annotated[Real, Field(description="Duty cycles since new when the run was made")]
Revision = Annotated[int, Field(description="Increases with every change of the clutch's results")]
Next = Annotated[str | None, Field(description="The `cursor` of the next page; null on the last one")]


def of_row(answer: type[Row], row: object, **own: Any) -> Row:
    """An answer made from a stored row, field by field; `own` gives fields with another name in the row or missing from
    it."""
    return answer(**{name: own[name] if name in own else getattr(row, name) for name in answer.model_fields})


class Page(Answer, Generic[Item]):
    """A part of a list."""

    items: list[Item]
    next: Next
