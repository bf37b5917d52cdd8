"""Parameters of addresses and questions, each with its bounds and description."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from service.schemas.base import (
    IDENTIFIER_PATTERN,
    LONGEST_FILENAME,
    LONGEST_IDENTIFIER,
    LONGEST_MAP,
    LONGEST_NUMBER,
    LONGEST_SEARCH,
    MAX_CYCLES,
    MAX_DRAWS,
    MAX_OFFSET,
    MAX_POINTS,
    MAX_SKIPPED,
    StartedAt,
)
from service.schemas.diagnosis import JobState
from service.schemas.life import SeriesQuantity


def _short(value: object) -> object:
    if isinstance(value, str) and len(value) > LONGEST_NUMBER:
        raise ValueError(f"a number has at most {LONGEST_NUMBER} characters")
    return value


#: Of every argument that is a number: refuses what none is by its length.
SHORT = BeforeValidator(_short)

ClutchId = Annotated[str, Field(description="The clutch's name")]
RunId = Annotated[str, Field(description="The run's name")]
DiagnosisId = Annotated[str, Field(description="The diagnosis' name")]
JobId = Annotated[str, Field(description="The job's name")]
OfState = Annotated[JobState | None, Field(description="Jobs in this state only; left out, all")]
RigName = Annotated[str, Field(description="The rig's name")]
InspectionId = Annotated[str, Field(description="The inspection's name")]
PhotographId = Annotated[str, Field(description="The photograph's name, the SHA-256 of its bytes")]
Points = Annotated[
    int | None,
    SHORT,
    Field(
        ge=1,
        le=MAX_POINTS,
        description="Samples of each channel at most, for a plot: of a sampled record those are answered where a channel is "
        "lowest or highest within its bin, and the first and the last; left out, all. Plateaus and Parquet are whole",
    ),
]
Quantity = Annotated[SeriesQuantity | None, Field(description="Rows of this quantity only")]
EngagementRun = Annotated[
    str | None,
    Field(
        max_length=LONGEST_IDENTIFIER,
        description="The run whose measured engagement is compared with the model; left out, the newest of the life",
    ),
]
TrackedQuantity = Annotated[
    str | None,
    Field(
        max_length=LONGEST_FILENAME,
        description="A quantity that is tracked: `mean_cof`, a Stribeck parameter such as `static_torque_nm`, `slope`, "
        "`attractor`, `film_time`, `loop_area`, one of engagements such as `stop_time_s`; left out, mean COF (and in "
        "`/degradation` every parameter)",
    ),
]
LifeNumber = Annotated[
    int | None,
    SHORT,
    Field(
        ge=1, description="The life by its number, from 1 on; left out, the present one. A rebuild begins a new life"
    ),
]
Draws = Annotated[
    int, SHORT, Field(ge=0, le=MAX_DRAWS, description="Joint draws of the coefficients of eq. 6 for each track")
]
RunKind = Annotated[
    Literal["stationary_stribeck", "dynamic_stribeck", "duty_cycles", "run_in", "maintenance"] | None,
    Field(description="Runs of this kind only; left out, all"),
]
State = Annotated[
    Literal["accepted", "held", "withdrawn"] | None, Field(description="Runs in this state only; left out, all")
]
Archived = Annotated[bool, Field(description="The archived clutches instead of those in use")]
ClutchStateName = Annotated[
    Literal["failure", "maintenance", "check", "out_of_specification", "normal"] | None,
    Field(description="Clutches in this state only, after NAMUR NE 107; left out, all"),
]
Held = Annotated[bool, Field(description="Clutches with runs that are held only")]
Find = Annotated[
    str,
    Field(
        max_length=LONGEST_SEARCH,
        pattern=r"^[^\x00-\x1f]*$",
        description="Clutches whose name, friction material or fluid contains this, whatever its case; left out, all",
    ),
]
Sort = Annotated[
    Literal["worst", "name", "kind"],
    Field(
        description="`worst`: the lowest safe bound first, a view of the moment: a clutch whose remaining cycles "
        "change between two pages may be on both or on neither. `name`: by name; a walk from page to page meets each "
        "clutch once. `kind`: those of the same friction material, reaction plate and fluid together, the worst first"
    ),
]
Offset = Annotated[
    int,
    SHORT,
    Field(
        ge=0, le=MAX_OFFSET, description="Clutches to pass over, to show a part of the list; a walk takes the cursor"
    ),
]

# --- of a posted file: what a JSON run has in fields ---

FileKind = Annotated[
    Literal["stationary_stribeck", "dynamic_stribeck"] | None,
    Field(description="The kind of run; left out, as the rig's profile finds it"),
]
FileCycles = Annotated[
    float | None,
    SHORT,
    Field(
        ge=0,
        le=MAX_CYCLES,
        allow_inf_nan=False,
        description="Duty cycles since new when the run is made; left out, as the rig's profile finds them",
    ),
]
FileRig = Annotated[
    str | None,
    Field(pattern=IDENTIFIER_PATTERN, description="The rig by whose profile the file is read; other arguments win"),
]
OfClutch = Annotated[
    str | None,
    Field(pattern=IDENTIFIER_PATTERN, description="The clutch whose geometry and torque filter evaluate the file"),
]
FileMap = Annotated[
    str | None, Field(max_length=LONGEST_MAP, description="Columns of channels: torque_nm:Mz,speed_rpm:n")
]
FileTable = Annotated[
    str,
    Field(max_length=LONGEST_FILENAME, description="The sheet, group or archived file, where there are several"),
]
FileTime = Annotated[
    str, Field(max_length=LONGEST_FILENAME, description="The time column; `none` where each row is a plateau")
]
FileDecimal = Annotated[
    Literal["", ".", ","], Field(description="The decimal sign; needed where 1.100 may be 1.1 or 1100")
]
FileMissing = Annotated[
    str,
    Field(
        max_length=LONGEST_FILENAME,
        description="Marks of missing values, as -9999,n/a: rows with one, or with an empty cell, are left out; `none`: all "
        "numbers are measured",
    ),
]
FileSkipRows = Annotated[
    int, SHORT, Field(ge=0, le=MAX_SKIPPED, description="Lines above the table that are not looked at")
]
FileName = Annotated[str, Field(max_length=LONGEST_FILENAME, description="The sender's name for the file")]
FileRunId = Annotated[
    str | None, Field(pattern=IDENTIFIER_PATTERN, description="The run's name; left out, it derives from the content")
]
FileStartedAt = Annotated[StartedAt | None, Field(description="When the run was started: ISO 8601 with a time zone")]
