"""Rig profiles: how the files that a rig's recorder writes are read; and the preview of a file before it is sent."""

from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.schemas.base import (
    LARGEST_NUMBER,
    LONGEST_NAME,
    LONGEST_TITLE,
    MAX_COLUMNS,
    MAX_SKIPPED,
    MAX_WORDS,
    Answer,
    Identifier,
    Schema,
    page_of,
)
from service.schemas.run import Fit, Warned

FileKindName = Literal["stationary_stribeck", "dynamic_stribeck"]
ChannelName = Literal[
    "time_s", "pressure_bar", "speed_rpm", "torque_nm", "torque_sd_nm", "oil_temperature_c",
    "plate_temperature_front_c", "plate_temperature_rear_c",
]  # fmt: skip
Text = Annotated[str, StringConstraints(min_length=1, max_length=LONGEST_NAME)]
Number = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]


class RigColumn(Schema):
    """One column of the rig's files: a channel's, or one that is left out."""

    title: Annotated[str, StringConstraints(min_length=1, max_length=LONGEST_TITLE)] = Field(
        description="Its title in the file, without the unit; `group/title` in files with groups"
    )
    channel: ChannelName | None = Field(default=None, description="The channel; null: the column is left out")
    unit: Text | None = Field(default=None, description="Its unit; null: the one that the file states")
    stated: Text | None = Field(
        default=None,
        description="What the file states in place of `unit`; a file that states a third one is refused",
    )
    scale: Number = Field(
        default=1.0, description="Channel = `scale` · value + `offset`, all in the channel's unit; not 0"
    )
    offset: Number = Field(default=0.0, description="Added after scaling, in the channel's unit: a zero that is off")

    @model_validator(mode="after")
    def _scaled(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale must not be 0")
        return self


class RigProfile(Schema):
    """How the files of a rig are read. What a request states itself comes before it."""

    columns: list[RigColumn] = Field(
        min_length=1, max_length=MAX_COLUMNS, description="The columns by their titles; others are left out"
    )
    decimal: Literal[".", ","] | None = Field(
        default=None, description="The decimal mark of text files, the other one then separates thousands; null: found"
    )
    table: Text | None = Field(
        default=None,
        description="The sheet, group or test of a file with several, by its name or its number from 1 on; null: the only",
    )
    skip_rows: Annotated[int, Field(ge=0, le=MAX_SKIPPED)] = Field(
        default=0, description="Lines above the titles that are not looked at"
    )
    missing: Text | None = Field(
        default=None,
        description="Marks of missing values, as `-9999,n/a`: rows with one, or with an empty cell, are left out; `none`: "
        "all numbers are measured; null: a file with numbers that may be such marks is refused",
    )
    kind: FileKindName | None = Field(default=None, description="The kind of run; null: by `file_name`, or asked for")
    file_name: Text | None = Field(
        default=None,
        description="What the file's name says: `{cycles}`, `{kind}`, `{run_id}` and `*` stand for what differs",
    )
    kinds: dict[Text, FileKindName] = Field(
        default_factory=dict, max_length=MAX_WORDS, description="The words that stand for `{kind}` in the name"
    )
    cycles_cell: Text | None = Field(
        default=None, description="The words above the table beside which the cycles stand, such as `Lastspiele`"
    )

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        for name in ("title", "channel"):
            given = [value for column in self.columns if (value := getattr(column, name)) is not None]
            twice = next((value for value in given if given.count(value) > 1), None)
            if twice is not None:
                raise ValueError(f"each {name} must stand once among the columns, {twice!r} stands twice")
        if not any(column.channel for column in self.columns):
            raise ValueError("at least one column must be a channel's")
        return self


class RigIn(RigProfile):
    """A rig profile as it is posted."""

    name: Identifier = Field(description="The rig's name")


class RigOut(RigIn):
    """A rig profile as it is in force."""

    version: int = Field(description="1 for a new profile, and one more each time it was replaced")
    saved_at: str = Field(description="When; UTC, ISO 8601")
    saved_by: str = Field(description="Who: `key:` with the key's id and note, or `local`")


RigPage = page_of("RigPage", RigOut, "Rig profiles by name.", "The profiles of this page")


class PreviewColumn(Answer):
    """A column of a file as it is read."""

    title: str = Field(description="Its title, as a profile names it")
    stated_unit: str | None = Field(description="The unit that the file states; null: none")
    unit: str | None = Field(description="The unit in which it is understood; null: none, or the column is left out")
    channel: ChannelName | None = Field(description="The channel that it is read as; null: it is left out")
    scale: float = Field(description="The scale that is applied, in the channel's unit")
    offset: float = Field(description="The offset that is applied, in the channel's unit")


class PreviewPiece(Answer):
    """What is cut out of a sampled record: a plateau, or the stretch of a dynamic test at one pressure."""

    start_s: float = Field(description="Its start, s")
    stop_s: float = Field(description="Its end, s")
    pressure_bar: float = Field(description="Line pressure, bar")
    speed_rpm: float | None = Field(description="Speed of a plateau, rpm; null for a stretch")


class Preview(Answer):
    """A file as it would be read and evaluated; nothing is stored."""

    filename: str = Field(description="The sender's name for it")
    above: list[list[str]] = Field(description="The lines above the table, cell by cell")
    tables: list[str] = Field(description="The sheets, groups or tests of the file, where there are several")
    columns: list[PreviewColumn] = Field(description="Every column of the file")
    first_rows: list[list[str]] = Field(description="The first rows as the file has them, a text a column")
    units: dict[str, list[str]] = Field(description="Units that a column of each channel may be in")
    rig: str | None = Field(description="The profile that was applied: the one asked for, or the one that fits")
    profile: RigProfile = Field(description="How it was read, as a profile that could be saved")
    kind: FileKindName | None = Field(
        description="The kind of run: asked for, by the profile, or the only one that fits"
    )
    cycles: float | None = Field(description="Cycles: asked for, or by the profile from the file's name or a cell")
    run_id: str | None = Field(description="The run's name, where the profile finds one in the file's name")
    kinds: list[FileKindName] = Field(description="The kinds of run that the channels allow")
    missing: list[str] = Field(description="What must still be given before it can be sent: channels, `kind`, `cycles`")
    rows: int = Field(description="Samples of each channel")
    channels: dict[str, list[float]] = Field(description="The channels as they are read, thinned for a plot")
    pieces: list[PreviewPiece] = Field(description="What is cut from a sampled record")
    fits: list[Fit] = Field(description="The curves that are fitted, as a receipt has them")
    warnings: list[Warned] = Field(
        description="Warnings of reading, cutting and fitting; what was left out is among them"
    )
    problem: str | None = Field(description="Why the file would be refused as it is; null: it would be taken")
