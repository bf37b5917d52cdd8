"""`/v1/rigs`: rig profiles in force, by name; `/v1/import/preview`: a file as it would be read and evaluated by one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.records.decimation import extreme_rows
from models.records.plateaus import cut_plateaus
from models.records.pressure_levels import pressure_stretches
from service import repository
from service.api.clutch import ClutchIn
from service.api.rig import (
    FileKindName,
    Preview,
    PreviewColumn,
    PreviewPiece,
    RigColumn,
    RigOut,
    RigPage,
    RigProfile,
    SuggestedRun,
)
from service.api.run import Fit, Warned
from service.channels import CHANNELS, RADIANS_PER_SECOND_PER_RPM, bar
from service.clutch.analysis import analyse
from service.clutch.incoming_run import IncomingRun, SampledChannels
from service.clutch.items import fit_items, warned, warnings_of_file
from service.errors import InvalidError
from service.paging import Part, by_name
from service.readers.preview import ShownColumn, ShownTable
from service.readers.read_file import preview_file, read_file
from service.readers.table import Reading
from service.readers.unit_table import spellings
from service.runs.channels_run import NEEDED, run_of
from service.runs.file_names import Suggested, suggested
from service.runs.rig_profile import Named, fits, named, pattern_for
from service.runs.suggestion import suggestion_of
from service.runs.upload import reading_with
from storage import clutches, rigs
from storage.engine.database import Database

_KINDS: Sequence[FileKindName] = get_args(FileKindName)
#: Samples of each channel that are answered. Chosen: twice the pixels of a plot's width.
_POINTS = 2000


def page(database: Database, part: Part) -> RigPage:
    """A page of profiles by name; shorter than asked for if they would need too much memory."""
    part = replace(part, limit=min(part.limit, rigs.MAX_AT_ONCE))
    with database.reading() as connection:
        rows = rigs.page(connection, limit=part.most, after=part.name)
    return part.of(RigPage, rows, by_name("name"), repository.rig_out)


def rig_profile(database: Database, name: str) -> RigOut:
    """The profile with this name. Raises NotFoundError."""
    with database.reading() as connection:
        return repository.rig(connection, name)


def is_saved(database: Database, name: str) -> bool:
    """Whether a profile has this name."""
    with database.reading() as connection:
        return rigs.get(connection, name) is not None


def preview(
    database: Database,
    path: Path,
    *,
    filename: str,
    rig: str | None,
    profile: RigProfile | None,
    kind: FileKindName | None,
    cycles: float | None,
    clutch_id: str | None,
    reading: Reading,
    beside: Sequence[str] = (),
) -> Preview:
    """A preview of a file's channels, plateaus and fits. The file is read by `profile`, the profile of `rig`, or the
    saved profile that has its columns; else by its column titles, completed by a suggestion if they do not suffice.
    `reading` (columns, decimal sign, missing values) takes precedence. `beside`: names of files sent with it.

    `clutch_id`: a registered clutch with the geometry and torque filter for the evaluation. Raises InvalidError or
    TooLargeError if no table is found, NotFoundError if the rig is unknown.
    """
    geometry, torque_filter = _clutch(database, clutch_id)
    if profile is None and rig is not None:
        profile = rig_profile(database, rig)
    shown = preview_file(path, filename=filename, reading=reading_with(profile, reading))
    if profile is None:
        rig, profile = _fitting(database, shown, filename)
        shown = preview_file(path, filename=filename, reading=reading_with(profile, reading)) if profile else shown
    from_profile = Named() if profile is None else named(profile, filename, shown["labels"])
    said = suggested(filename, beside, shown["labels"])
    used = _with_stated(_by_titles(shown) if profile is None else profile, shown, reading)
    kind, cycles = kind or from_profile.kind, from_profile.cycles if cycles is None else cycles
    by_titles = profile is None and shown["problem"] is None  # as a push reads it; else with what is open left open
    read_by = reading_with(None if by_titles else used, reading if by_titles else Reading(time=reading.time))
    evaluate = partial(_evaluated, path, filename, geometry=geometry, torque_filter=torque_filter)
    evaluated = evaluate(None if used is None else read_by, kind)
    suggestion = None
    lacking = f"no column is known as {', '.join(evaluated.missing)}" if evaluated.missing else ""
    if profile is None and (why := shown["problem"] or evaluated.problem or lacking):
        suggestion = suggestion_of(
            path, filename=filename, reading=reading, kind=kind, cycles=cycles, beside=beside, why=why
        )
    if suggestion is not None:
        used = suggestion.profile
        read_by = replace(reading_with(used, reading), time=suggestion.time)
        shown = preview_file(path, filename=filename, reading=read_by)
        evaluated = evaluate(read_by, kind or suggestion.kind)
    kind = kind or (evaluated.kinds[0] if len(evaluated.kinds) == 1 else None)
    usable = _first_of_each(shown["columns"])
    columns = [_column(shown["columns"][index], used) for index in usable]
    missing = [
        *evaluated.missing,
        *(f"unit of {column.title}" for column in columns if column.channel and not column.unit),
        *(["kind"] if kind is None else []),
        *(["cycles"] if cycles is None else []),
    ]
    return Preview(
        filename=filename,
        above=shown["above"],
        tables=shown["tables"],
        columns=columns,
        first_rows=[[row[index] if index < len(row) else "" for index in usable] for row in shown["head"]],
        units={name: spellings(name).split(", ") for name in CHANNELS},
        rig=rig,
        profile=_saveable([column.title for column in columns], used, kind, filename, cycles, said),
        kind=kind,
        cycles=cycles,
        run_id=from_profile.run_id,
        clutch_id=from_profile.clutch_id,
        suggested_run=SuggestedRun(kind=said.named.kind, cycles=said.named.cycles, clutch_id=said.named.clutch_id),
        suggestion=suggestion,
        **vars(evaluated) | {"missing": missing},
    )


def _with_stated(used: RigProfile | None, shown: ShownTable, reading: Reading) -> RigProfile | None:
    """A profile updated by the request: missing and good marks, decimal sign, and column map."""
    if used is None:
        return None
    stated = {name: value for name in ("decimal", "missing", "good") if (value := getattr(reading, name))}
    used = used.model_copy(update=stated)
    if reading.mapping and (titled := _by_titles(shown)):
        of_file = [column for column in titled.columns if not column.title.startswith("=")]
        used = used.model_copy(update={"columns": of_file + _stated_without_column(reading)})
    return used


def _clutch(database: Database, clutch_id: str | None) -> tuple[Geometry, float]:
    """Geometry and torque filter of a clutch; those of the reference if none is given or it is not registered."""
    with database.reading() as connection:
        row = None if clutch_id is None else clutches.get(connection, clutch_id)
    record = ClutchIn(clutch_id="any") if row is None else repository.record(row)
    return record.geometry.to_model(), record.torque_filter


def _title(column: ShownColumn) -> str:
    return f"{column['group']}/{column['name']}" if column["group"] else str(column["name"])


def _first_of_each(columns: Sequence[ShownColumn]) -> list[int]:
    """The indices of titled columns, only the first of columns with equal titles."""
    titles = [_title(column) if column["name"] else "" for column in columns]
    return [index for index, title in enumerate(titles) if title and titles.index(title) == index]


def _fitting(database: Database, shown: ShownTable, filename: str) -> tuple[str | None, RigProfile | None]:
    """The one saved profile that has the file's columns; if several do, the one with a pattern matching the file's
    name."""
    titles = [_title(column) for column in shown["columns"] if column["name"]]
    with database.reading() as connection:
        fitting = [repository.rig_out(row) for row in rigs.every(connection) if fits(row.content, titles)]
    if len(fitting) > 1:
        # a name that says nothing leaves the profile's own kind
        fitting = [
            profile
            for profile in fitting
            if profile.file_name and named(profile, filename, {}) != Named(kind=profile.kind)
        ]
    return (fitting[0].name, fitting[0]) if len(fitting) == 1 else (None, None)


def _by_titles(shown: ShownTable) -> RigProfile | None:
    """The columns with the channels named by their titles; None if no title names a channel. A channel named by two
    columns is left open."""
    channels = [column["channel"] for column in shown["columns"]]
    columns: dict[str, dict[str, object]] = {}
    for column, channel in zip(shown["columns"], channels, strict=True):
        if column["name"]:
            only = channel is not None and channels.count(channel) == 1
            read = {"channel": channel, "unit": column["stated"]} if only else {"channel": None}
            columns.setdefault(_title(column), {"title": _title(column), **read})
    if not any(column["channel"] for column in columns.values()):
        return None
    return RigProfile.model_validate({"columns": list(columns.values())})


def _stated_without_column(reading: Reading) -> list[RigColumn]:
    """The mapped channels that have constants in place of columns, as columns of a profile."""
    return [
        RigColumn.model_validate({"title": choice.column, "channel": channel})
        for channel, choice in reading.mapping.items()
        if choice.column.startswith("=")
    ]


def _column(column: ShownColumn, profile: RigProfile | None) -> PreviewColumn:
    """A column of a file as its preview shows it: the title, the unit, and the channel by the rig profile."""
    title = _title(column)
    profile_column = next((item for item in profile.columns if item.title == title), None) if profile else None
    channel = None if profile_column is None else profile_column.channel
    return PreviewColumn(
        title=title,
        stated_unit=column["unit"],
        unit=column["read_in"] if channel == column["channel"] else None,
        channel=channel,
        scale=1.0 if profile_column is None else profile_column.scale,
        offset=0.0 if profile_column is None else profile_column.offset,
    )


def _saveable(
    titles: Sequence[str],
    used: RigProfile | None,
    kind: FileKindName | None,
    filename: str,
    cycles: float | None,
    said: Suggested,
) -> RigProfile:
    """The profile in a form that can be saved: with all columns, and with a source of cycles and clutch: a pattern of
    the file's name, or labels above the table."""
    profile_columns = {column.title: RigColumn(**dict(column)) for column in used.columns} if used else {}
    profile_fields = {} if used is None else dict(used)
    in_cell = said.cycles_cell is not None and cycles in (None, said.named.cycles)
    pattern = said.file_name if cycles is None else pattern_for(filename, cycles, said.named.clutch_id)
    found = {"kind": kind, "cycles_cell": said.cycles_cell if in_cell else None, "clutch_cell": said.clutch_cell}
    found["file_name"] = pattern
    own = {name: profile_fields.get(name) or value for name, value in found.items()}
    of_file = [title for title in titles if not title.startswith("=")]
    columns = [profile_columns.get(title, RigColumn(title=title, channel=None)) for title in of_file]
    columns += [column for title, column in profile_columns.items() if title.startswith("=")]
    fields = profile_fields | own | {"columns": columns}
    of_profile = {name: value for name, value in fields.items() if name in RigProfile.model_fields}
    return RigProfile.model_construct(**of_profile)  # not checked: no column need have a channel yet


@dataclass(frozen=True, kw_only=True)
class _Evaluated:
    """A file's channels, plateaus and fits for its preview; `problem`: why the file would be refused."""

    rows: int = 0
    kinds: list[FileKindName] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    channels: dict[str, list[float]] = field(default_factory=dict)
    pieces: list[PreviewPiece] = field(default_factory=list)
    fits: list[Fit] = field(default_factory=list)
    warnings: list[Warned] = field(default_factory=list)
    problem: str | None = None


def _evaluated(
    path: Path,
    filename: str,
    reading: Reading | None,
    kind: FileKindName | None,
    *,
    geometry: Geometry,
    torque_filter: float,
) -> _Evaluated:
    """Evaluate a file for its preview: channels, plateaus and fits; `problem` says why the file would be refused."""
    answer = _Evaluated()
    if reading is None:
        return replace(answer, missing=list(NEEDED["stationary_stribeck"]))
    try:
        read = read_file(path, filename=filename, reading=reading)
        columns, samples = read.columns, max(column.size for column in read.columns.values())
        answer = _Evaluated(
            rows=samples,
            channels=_drawn(columns, samples),
            kinds=[name for name in _KINDS if columns.keys() >= set(NEEDED[name])],
            missing=[name for name in NEEDED[kind or "stationary_stribeck"] if name not in columns],
            warnings=warned(read.notices),
        )
        kind = kind or (answer.kinds[0] if len(answer.kinds) == 1 else None)
        if kind is None or answer.missing:
            return answer
        run = run_of(read, IncomingRun(kind=kind, cycles=0.0, run_id=""))
        analysis = analyse(run, geometry, torque_filter)
        return replace(
            answer,
            pieces=_pieces(run, torque_filter),
            fits=fit_items(analysis.fits, {}),
            warnings=[*warnings_of_file(run), *warned(analysis.warnings)],
        )
    except InvalidError as error:
        return replace(answer, problem=error.detail)


def _drawn(columns: Mapping[str, FloatArray], samples: int) -> dict[str, list[float]]:
    """The channels as lists for a plot, thinned to the extreme rows."""
    if samples > _POINTS:
        rows = extreme_rows(columns.values(), len(columns), samples=samples, points=_POINTS)
        columns = {name: column[rows] for name, column in columns.items()}
    return {name: column.tolist() for name, column in columns.items()}


def _pieces(run: IncomingRun, torque_filter: float) -> list[PreviewPiece]:
    """The plateaus of a sampled stationary test, or the constant-pressure stretches of a dynamic test."""
    if "time_s" not in run.channels:
        return []
    record = SampledChannels(run.channels)
    if run.kind == "stationary_stribeck":
        cut = cut_plateaus(record, torque_filter)
        speeds: Sequence[float | None] = (cut.plateaus.speed / RADIANS_PER_SECOND_PER_RPM).tolist()
        plateaus = zip(cut.start.tolist(), cut.stop.tolist(), cut.plateaus.pressure.tolist(), speeds, strict=True)
        return [_piece(*piece) for piece in plateaus]
    order = np.argsort(record.time, kind="stable")
    time = record.time[order]
    stretches = pressure_stretches(time, record.pressure[order])
    return [_piece(float(time[s.start]), float(time[s.stop - 1]), s.pressure, None) for s in stretches]


def _piece(start: float, stop: float, pressure: float, speed: float | None) -> PreviewPiece:
    """A part of a record at one pressure, as the preview shows it."""
    return PreviewPiece(start_s=start, stop_s=stop, pressure_bar=bar(pressure), speed_rpm=speed)
