"""Parameters of addresses and questions, each with its bounds and description."""

from typing import Annotated, Literal

from pydantic import AwareDatetime, Field

from service.schemas.limits import IDENTIFIER_PATTERN, LONGEST_FILENAME, LONGEST_MAP, MOST_CYCLES, MOST_POINTS

ClutchId = Annotated[str, Field(description="The clutch's name")]
RunId = Annotated[str, Field(description="The run's name")]
DiagnosisId = Annotated[str, Field(description="The diagnosis' name")]
Points = Annotated[
    int | None,
    Field(
        ge=1,
        le=MOST_POINTS,
        description="Samples of each channel at most, for a plot: of a sampled record those are answered where a channel is "
        "lowest or highest within its bin, and the first and the last; left out, all. Plateaus and Parquet are whole",
    ),
]
Quantity = Annotated[str | None, Field(description="Rows of this quantity only")]
State = Annotated[
    Literal["accepted", "held", "withdrawn"] | None, Field(description="Runs in this state only; left out, all")
]
Archived = Annotated[bool, Field(description="The archived clutches instead of those in use")]

# --- of a posted file: what a JSON run has in fields ---

FileKind = Annotated[Literal["stationary_stribeck", "dynamic_stribeck"], Field(description="The kind of run")]
FileCycles = Annotated[
    float, Field(ge=0, le=MOST_CYCLES, allow_inf_nan=False, description="Duty cycles since new when the run is made")
]
FileMap = Annotated[
    str | None, Field(max_length=LONGEST_MAP, description="Columns of channels: torque_nm:Mz,speed_rpm:n")
]
FileName = Annotated[str, Field(max_length=LONGEST_FILENAME, description="The sender's name for the file")]
FileRunId = Annotated[
    str | None, Field(pattern=IDENTIFIER_PATTERN, description="The run's name; left out, it derives from the content")
]
FileStartedAt = Annotated[
    AwareDatetime | None, Field(description="When the run was started: ISO 8601 with a time zone")
]
