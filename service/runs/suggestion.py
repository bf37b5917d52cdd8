"""A suggestion for a file that is not read without a question: its reading (`readers.suggest`), its kind, cycles and clutch.

In: the file, and what was asked of it. Out: `Suggestion`, complete, for a person to confirm; or nothing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from models.arrays import FloatArray
from service.api.rig import ChannelName, FileKindName, RigColumn, RigIn, RigProfile, Suggestion
from service.clutch.incoming_run import IncomingRun
from service.errors import InvalidError, ServiceError
from service.readers.assemble import Channels
from service.readers.read_file import read_file, suggest_file
from service.readers.table import ALL, NO_TIME, ColumnChoice, Reading
from service.runs.channels_run import holds_no_dwell, run_of, slower_than_samples
from service.runs.file_names import suggested

#: Rows that are shown.
_ROWS = 2
#: The confidence that rows which are too far apart for samples are plateaus, and that the first of several tests in a file
#: is the one that is meant. Chosen.
_PLATEAUS, _FIRST_OF_SEVERAL = 0.8, 0.5
#: A level of a part that is that of another one, as a share of it. Chosen.
_SAME_LEVEL = 0.1
_CHANNELS: Sequence[ChannelName] = get_args(ChannelName)


def suggestion_of(
    path: Path,
    *,
    filename: str,
    reading: Reading,
    kind: FileKindName | None = None,
    cycles: float | None = None,
    beside: Sequence[str] = (),
    why: str = "",
) -> Suggestion | None:
    """A suggested way to read a file; None if none gives a test. `beside`: names of files sent with it; `why`: why it
    could not be read.
    """
    try:
        proposal = suggest_file(path, filename=filename, reading=reading)
        if proposal is None:
            return None
        reading, confidence = proposal.reading, proposal.confidence
        read = read_file(path, filename=filename, reading=reading)
        if kind != "dynamic_stribeck" and slower_than_samples(read.columns):
            untimed = {channel: choice for channel, choice in reading.mapping.items() if channel != "time_s"}
            reading = replace(reading, mapping=untimed, time=NO_TIME)
            read, kind = read_file(path, filename=filename, reading=reading), "stationary_stribeck"
            confidence = min(confidence, _PLATEAUS)
        said = suggested(filename, beside, read.labels)
        kind = kind or said.named.kind or _kind(read.columns)
        if _holds_several(read.columns, kind, in_parts=reading.table == ALL):
            reading, confidence = _first_test(path, filename, reading), min(confidence, _FIRST_OF_SEVERAL)
            read = read_file(path, filename=filename, reading=reading)
        run_of(read, IncomingRun(kind=kind, cycles=0.0, run_id=""))
    except ServiceError:  # damaged, too large, no table, busy, or no run: the refusal itself stands
        return None
    columns = _columns(reading, proposal.titles)
    profile = RigProfile(
        columns=columns,
        decimal="," if reading.decimal == "," else "." if reading.decimal else None,
        table=reading.table or None,
        skip_rows=reading.skip_rows,
        missing=reading.missing or None,
        good=reading.good or None,
        kind=kind,
        file_name=said.file_name,
        cycles_cell=said.cycles_cell,
        clutch_cell=said.clutch_cell,
    )
    return Suggestion(
        why=why,
        map={column.channel: _as_argument(reading.mapping[column.channel]) for column in columns if column.channel},
        table=reading.table,
        time=reading.time,
        decimal=reading.decimal,
        missing=reading.missing,
        good=reading.good,
        kind=kind,
        cycles=said.named.cycles if cycles is None else cycles,
        clutch_id=said.named.clutch_id,
        confidence=confidence,
        rows=_rows(read),
        profile=profile,
    )


def _holds_several(columns: Mapping[str, FloatArray], kind: FileKindName, *, in_parts: bool) -> bool:
    """Whether a file that was read as a whole holds several tests: dynamic ones in its parts or where the clock goes back;
    stationary ones in parts with the same levels."""
    if kind == "dynamic_stribeck":
        return in_parts or bool("time_s" in columns and (np.diff(columns["time_s"]) < 0).any())
    return in_parts and all(_comes_back(columns[name]) for name in ("pressure_bar", "speed_rpm"))


def _comes_back(values: FloatArray) -> bool:
    """Whether a level of a channel [n] comes back after another one."""
    levels: list[float] = []
    for value in values.tolist():
        if not levels or abs(value - levels[-1]) > _SAME_LEVEL * max(abs(levels[-1]), 1.0):
            levels.append(value)
    ordered = np.sort(levels)
    return bool((np.diff(ordered) < _SAME_LEVEL * np.maximum(ordered[1:], 1.0)).any())


def _first_test(path: Path, filename: str, reading: Reading) -> Reading:
    """The reading of the first of a file's tests: each is one of its tables, or begins where the clock goes back."""
    try:
        read_file(path, filename=filename, reading=replace(reading, table=""))
    except InvalidError as error:
        if error.errors and error.errors[0].code == "which_table":
            return replace(reading, table=error.errors[0].value)
        raise
    return replace(reading, table="1")


def confirmed_profile(path: Path, rig: str, profile: RigProfile | None, **asked: Any) -> RigIn:
    """The profile of a new rig: the one sent, or one made from the reading arguments `asked`, as in `suggestion_of`.
    Raises InvalidError if the file gives no test by it."""
    if profile is None:
        suggestion = suggestion_of(path, **asked)
        if suggestion is None:
            message = f"rig {rig!r} is new, and the file gives no test by these arguments that could be its profile"
            raise InvalidError.of(message, code="no_profile", pointer="/query/rig")
        profile = suggestion.profile
    return RigIn(name=rig, **profile.model_dump(include={*RigProfile.model_fields}))


def _columns(reading: Reading, titles: Sequence[str]) -> list[RigColumn]:
    """The columns used by a reading, and the file's other columns."""
    chosen = {choice.column: (channel, choice.unit) for channel, choice in reading.mapping.items()}
    listed = [title for title in dict.fromkeys(titles) if title not in chosen]
    columns = [RigColumn.model_validate({"title": t, "channel": of, "unit": unit}) for t, (of, unit) in chosen.items()]
    return columns + [RigColumn(title=title) for title in listed]


def _as_argument(choice: ColumnChoice) -> str:
    """A chosen column as an argument of the upload."""
    return choice.column if choice.unit is None else f"{choice.column} [{choice.unit}]"


def _rows(read: Channels) -> list[dict[ChannelName, float]]:
    size = next(iter(read.columns.values())).size
    return [
        {name: float(read.columns[name][at]) for name in _CHANNELS if name in read.columns}
        for at in range(min(_ROWS, size))
    ]


def _kind(columns: Mapping[str, FloatArray]) -> FileKindName:
    """The kind of test by its record: dynamic if no stretch of it is constant for a while."""
    return "dynamic_stribeck" if "time_s" in columns and holds_no_dwell(columns) else "stationary_stribeck"
