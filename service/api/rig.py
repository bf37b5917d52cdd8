"""Rig profiles: how the files that a rig's recorder writes are read; and the preview of a file before it is sent."""

from collections import Counter
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from service.api import base
from service.api.base import Answer, Identifier, Page, Real, Schema
from service.api.run import Fit, Warned

FileKindName = Literal["stationary_stribeck", "dynamic_stribeck"]
ChannelName = Literal[
    "time_s", "pressure_bar", "speed_rpm", "torque_nm", "torque_sd_nm", "oil_temperature_c",
    "plate_temperature_front_c", "plate_temperature_rear_c",
]  # fmt: skip
Text = Annotated[str, StringConstraints(min_length=1, max_length=base.LONGEST_NAME)]
Number = Annotated[float, Field(ge=-base.LARGEST_NUMBER, le=base.LARGEST_NUMBER, allow_inf_nan=False)]


class RigColumn(Schema):
    """One column of the rig's files: a channel, or a column to ignore."""

    title: Annotated[str, StringConstraints(min_length=1, max_length=base.LONGEST_TITLE)] = Field(
        description="Its title in the file, without the unit; `group/title` in files with groups. Of a channel without a"
        " column `=5 bar`, `=LABEL` of a cell above the table, `=columns` or `=sheets` (a value in their names), `=cells`;"
        " of the time `=100 Hz`"
    )
    channel: ChannelName | None = Field(default=None, description="The channel; null: ignore the column")
    unit: Text | None = Field(default=None, description="Its unit; null: the unit in the file")
    stated: Text | None = Field(
        default=None, description="What the file writes instead of `unit`; any other unit in the file is refused"
    )
    scale: Number = Field(
        default=1.0, description="Channel = `scale` · value + `offset`, all in the channel's unit; not 0"
    )
    offset: Number = Field(default=0.0, description="Added after scaling, in the channel's unit; corrects a zero shift")

    @model_validator(mode="after")
    def _scaled(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale must not be 0")
        return self


class RigProfile(Schema):
    """How the files of a rig are read. Arguments of a request override it."""

    columns: list[RigColumn] = Field(
        min_length=1, max_length=base.MAX_COLUMNS, description="The columns by their titles; others are ignored"
    )
    decimal: Literal[".", ","] | None = Field(
        default=None,
        description="The decimal sign of text files; the other sign then separates thousands; null: detected",
    )
    table: Text | None = Field(
        default=None,
        description="The sheet, group or test of several, by name or number from 1; `*`: all; null: the only one",
    )
    skip_rows: Annotated[int, Field(ge=0, le=base.MAX_SKIPPED)] = Field(
        default=0, description="Number of lines above the titles to skip"
    )
    missing: Text | None = Field(
        default=None,
        description="Marks of missing values, such as `-9999,n/a`, of a channel as `torque_nm:0`: rows with one, or with an"
        " empty cell, are left out; `above`: an empty cell holds the value above it; `none`: all numbers are measurements;"
        " null: a file with suspicious numbers is refused",
    )
    good: Text | None = Field(
        default=None,
        description="The codes of a column of qualities that mark good rows, such as `0` or `192`: other rows are left out;"
        " `none`: all rows are read; null: a file with codes of unknown meaning is refused",
    )
    kind: FileKindName | None = Field(
        default=None, description="The kind of run; null: from `file_name` or from the request"
    )
    file_name: Text | None = Field(
        default=None,
        description="Pattern of the file's name: `{cycles}`, `{kind}`, `{run_id}`, `{clutch_id}` and `*` stand for the parts"
        " that change",
    )
    kinds: dict[Text, FileKindName] = Field(
        default_factory=dict, max_length=base.MAX_WORDS, description="The words that stand for `{kind}` in the name"
    )
    cycles_cell: Text | None = Field(
        default=None, description="Label above the table that stands beside the number of cycles, such as `Lastspiele`"
    )

    clutch_cell: Text | None = Field(
        default=None, description="Label above the table that stands beside the clutch's id, such as `Kupplung`"
    )

    @model_validator(mode="after")
    def _titles_and_channels_are_unique(self) -> Self:
        """Refuses a profile in which a title or channel stands twice, or no column holds a channel."""
        for name in ("title", "channel"):
            values = [value for column in self.columns if (value := getattr(column, name)) is not None]
            twice = next((value for value, count in Counter(values).items() if count > 1), None)
            if twice is not None:
                raise ValueError(f"each {name} must stand once among the columns, {twice!r} stands twice")
        if not any(column.channel for column in self.columns):
            raise ValueError("at least one column must hold a channel")
        return self


class RigIn(RigProfile):
    """A rig profile in a request."""

    name: Identifier = Field(description="The rig's name")


class RigOut(RigIn):
    """A saved rig profile."""

    version: int = Field(description="1 for a new profile; increases with each replacement")
    saved_at: str = Field(description="When; UTC, ISO 8601")
    saved_by: str = Field(description="Who: `key:` with the key's id and note, or `local`")


class RigPage(Page[RigOut]):
    """Rig profiles by name."""

    items: list[RigOut] = Field(description="The profiles of this page")


class PreviewColumn(Answer):
    """A column of a file as it is read."""

    title: str = Field(description="Its title, as a profile names it")
    stated_unit: str | None = Field(description="The unit that the file states; null: none")
    unit: str | None = Field(description="The unit that is used; null: none, or the column is ignored")
    channel: ChannelName | None = Field(description="The channel; null: the column is ignored")
    scale: Real = Field(description="The scale, in the channel's unit")
    offset: Real = Field(description="The offset, in the channel's unit")


class PreviewPiece(Answer):
    """A part of a sampled record: a plateau, or the part of a dynamic test at one pressure."""

    start_s: Real = Field(description="Its start, s")
    stop_s: Real = Field(description="Its end, s")
    pressure_bar: Real = Field(description="Line pressure, bar")
    speed_rpm: Real | None = Field(description="Speed of a plateau, rpm; null for a stretch")


class Suggestion(Answer):
    """A complete reading of a file that is not read without a question. Nothing is read by it until somebody confirms it:
    with the arguments `map`, `table`, `time`, ... as they stand here, or with `profile` in a form. A new name in `rig` keeps
    it as that rig's profile.
    """

    why: str = Field(description="Why the file is not read without a question")
    map: dict[ChannelName, str] = Field(description="The column of each channel, as the argument `map` takes it")
    table: str = Field(description="The sheet, group or archived file; may be empty")
    time: str = Field(description="The time column; `none`: each row is a plateau; empty: as `map` or the file says")
    decimal: str = Field(description="The decimal sign; empty: detected")
    missing: str = Field(description="Marks of missing values; may be empty")
    good: str = Field(description="Codes of good rows; may be empty")
    kind: FileKindName = Field(description="The kind of run, by the file's name or its channels")
    cycles: Real | None = Field(description="Cycles, by the file's name or a cell; null: nothing says them")
    clutch_id: str | None = Field(description="The clutch, by the file's name or a cell; null: nothing says it")
    confidence: Real = Field(description="How sure the columns, units and clock are, 0 to 1")
    rows: list[dict[ChannelName, Real]] = Field(
        description="The first rows as they would be read, in the channels' units"
    )
    profile: RigProfile = Field(description="The reading as a rig profile that can be saved")


class SuggestedRun(Answer):
    """What the names of the files and the cells above the table suggest of the run, for a person to confirm."""

    kind: FileKindName | None = Field(description="The kind of run; null: they do not say it")
    cycles: Real | None = Field(description="Cycles; null: they do not say them")
    clutch_id: str | None = Field(description="The clutch; null: they do not say it")


class Preview(Answer):
    """A file as it would be read and evaluated; nothing is stored."""

    filename: str = Field(description="The sender's name for it")
    above: list[list[str]] = Field(description="The lines above the table, cell by cell")
    tables: list[str] = Field(description="The sheets, groups or tests of the file, if there are several")
    columns: list[PreviewColumn] = Field(description="Every column of the file")
    first_rows: list[list[str]] = Field(description="The first rows of the file, one text per column")
    units: dict[str, list[str]] = Field(description="Units that a column of each channel may be in")
    rig: str | None = Field(description="The applied profile: the requested one, or the one that fits")
    profile: RigProfile = Field(description="How the file was read, as a profile that you can save")
    kind: FileKindName | None = Field(
        description="The kind of run: from the request or the profile, or the only one that fits"
    )
    cycles: Real | None = Field(
        description="Cycles: from the request, or through the profile from the file's name or a cell"
    )
    run_id: str | None = Field(description="The run's name, if the profile finds one in the file's name")
    clutch_id: str | None = Field(description="The clutch, if the profile finds it in the file's name or a cell")
    suggested_run: SuggestedRun = Field(description="What names and cells suggest of the run")
    suggestion: Suggestion | None = Field(
        description="If the file is not read without a question: how it may be read, which the rest of this preview shows"
    )
    rows: int = Field(description="Samples of each channel")
    kinds: list[FileKindName] = Field(description="The kinds of run that the channels allow")
    missing: list[str] = Field(
        description="What is still missing before the file can be sent: channels, `kind`, `cycles`"
    )
    channels: dict[str, list[Real]] = Field(description="The channels as they are read, thinned for a plot")
    pieces: list[PreviewPiece] = Field(description="The parts of a sampled record")
    fits: list[Fit] = Field(description="The fitted curves, as in a receipt")
    warnings: list[Warned] = Field(description="Warnings of reading, cutting and fitting, including what was left out")
    problem: str | None = Field(description="Why the file would be refused; null: it would be accepted")
