"""Parameters of addresses and questions, each with its bounds and description."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from service.api import base
from service.api.base import StartedAt
from service.api.diagnosis import JobState
from service.api.life import SeriesQuantity


def _short(value: object) -> object:
    if isinstance(value, str) and len(value) > base.LONGEST_NUMBER:
        raise ValueError(f"a number has at most {base.LONGEST_NUMBER} characters")
    return value


#: Of every argument that is a number: refuses what none is by its length.
SHORT = BeforeValidator(_short)

ClutchId = Annotated[str, Field(description="The clutch's name")]
RunId = Annotated[str, Field(description="The run's name")]
DoubtId = Annotated[str, Field(description="The doubt's name, `id` in a held run's `doubts`")]
DiagnosisId = Annotated[str, Field(description="The diagnosis' name")]
JobId = Annotated[str, Field(description="The job's name")]
OfState = Annotated[JobState | None, Field(description="Only jobs in this state; default: all")]
RigName = Annotated[str, Field(description="The rig's name")]
InspectionId = Annotated[str, Field(description="The inspection's name")]
PhotographId = Annotated[str, Field(description="The photograph's name, the SHA-256 of its bytes")]
Points = Annotated[
    int | None,
    SHORT,
    Field(
        ge=1,
        le=base.MAX_POINTS,
        description="Highest number of samples per channel, for a plot. The answer keeps the samples at which a "
        "channel is lowest or highest within its bin, the first and the last; default: all. Plateaus "
        "and Parquet are always complete",
    ),
]
Quantity = Annotated[SeriesQuantity | None, Field(description="Only rows of this quantity")]
EngagementRun = Annotated[
    str | None,
    Field(
        max_length=base.LONGEST_IDENTIFIER,
        description="The run whose measured engagement is compared with the model; default: the newest of the life",
    ),
]
TrackedQuantity = Annotated[
    str | None,
    Field(
        max_length=base.LONGEST_FILENAME,
        description="A tracked quantity: `mean_cof`, a Stribeck parameter such as `static_torque_nm`, `slope`, "
        "`attractor`, `film_time`, `loop_area`, or one of engagements such as `stop_time_s`; default:"
        " mean COF (in `/degradation` also every parameter)",
    ),
]
LifeNumber = Annotated[
    int | None,
    SHORT,
    Field(ge=1, description="Number of the life, from 1; default: the present one. A rebuild begins a new life"),
]
Draws = Annotated[
    int, SHORT, Field(ge=0, le=base.MAX_DRAWS, description="Joint draws of the coefficients of eq. 6 for each track")
]
RunKind = Annotated[
    Literal["stationary_stribeck", "dynamic_stribeck", "duty_cycles", "run_in", "maintenance"] | None,
    Field(description="Only runs of this kind; default: all"),
]
State = Annotated[
    Literal["accepted", "held", "withdrawn"] | None, Field(description="Only runs in this state; default: all")
]
Archived = Annotated[bool, Field(description="Archived clutches instead of those in use")]
ClutchStateName = Annotated[
    base.StateName | None, Field(description="Only clutches in this state by NAMUR NE 107; default: all")
]
Held = Annotated[bool, Field(description="Only clutches with held runs")]
Find = Annotated[
    str,
    Field(
        max_length=base.LONGEST_SEARCH,
        pattern=r"^[^\x00-\x1f]*$",
        description="Only clutches with this text in name, friction material or fluid, in upper or lower case; default: all",
    ),
]
Sort = Annotated[
    Literal["worst", "name", "kind"],
    Field(
        description="`worst`: what needs somebody first: by state, `failure` to `out_of_specification`, then clutches with"
        " an alarm that nobody acknowledged, then the others, ended lives last; among equals the lowest safe bound first. If"
        " they change between two pages, a clutch may be on both or on neither. `name`: by name; a walk from page to page"
        " meets each clutch once. `kind`: grouped by friction material, reaction plate and fluid, the worst first"
    ),
]
Offset = Annotated[
    int,
    SHORT,
    Field(
        ge=0, le=base.MAX_OFFSET, description="Number of clutches to skip. To read all pages, use the cursor instead"
    ),
]

# --- of a posted file: what a JSON run has in fields ---

FileKind = Annotated[
    Literal["stationary_stribeck", "dynamic_stribeck"] | None,
    Field(description="The kind of run; default: from the rig profile"),
]
FileCycles = Annotated[
    float | None,
    SHORT,
    Field(
        ge=0,
        le=base.MAX_CYCLES,
        allow_inf_nan=False,
        description="Duty cycles since new at the run; default: from the rig profile",
    ),
]
FileRig = Annotated[
    str | None,
    Field(pattern=base.IDENTIFIER_PATTERN, description="The rig profile for the file; other arguments override it"),
]
OfClutch = Annotated[
    str | None,
    Field(pattern=base.IDENTIFIER_PATTERN, description="The clutch whose geometry and torque filter evaluate the file"),
]
FileMap = Annotated[
    str | None,
    Field(max_length=base.LONGEST_MAP, description="The columns of the channels, such as torque_nm:Mz,speed_rpm:n"),
]
FileTable = Annotated[
    str,
    Field(
        max_length=base.LONGEST_FILENAME,
        description="The sheet, group or archived file, if there are several; `*`: all",
    ),
]
FileTime = Annotated[
    str, Field(max_length=base.LONGEST_FILENAME, description="The time column; `none`: each row is a plateau")
]
FileDecimal = Annotated[
    Literal["", ".", ","], Field(description="The decimal sign; required if 1.100 may be 1.1 or 1100")
]
FileMissing = Annotated[
    str,
    Field(
        max_length=base.LONGEST_FILENAME,
        description="Marks of missing values, such as -9999,n/a, of one channel as torque_nm:0: rows with one, or with an "
        "empty cell, are left out; `above`: an empty cell holds the value above it; `none`: all numbers are measurements",
    ),
]
FileGood = Annotated[
    str,
    Field(
        max_length=base.LONGEST_FILENAME,
        description="The codes of a column of qualities that mark good rows, such as 0 or 192: others are left out; `none`: "
        "all rows are read",
    ),
]
FileSkipRows = Annotated[
    int, SHORT, Field(ge=0, le=base.MAX_SKIPPED, description="Number of lines above the table to skip")
]
FileName = Annotated[str, Field(max_length=base.LONGEST_FILENAME, description="The sender's name for the file")]
FilesTogether = Annotated[
    list[Annotated[str, Field(max_length=base.LONGEST_FILENAME)]],
    Field(
        max_length=base.MAX_COLUMNS,
        description="The names of the files that came with it: what changes in all of them may be the cycles",
    ),
]
FileRunId = Annotated[
    str | None, Field(pattern=base.IDENTIFIER_PATTERN, description="The run's name; default: derived from the content")
]
FileStartedAt = Annotated[StartedAt | None, Field(description="When the run was started: ISO 8601 with a time zone")]
