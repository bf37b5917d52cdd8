"""A run posted as a file -> `IncomingRun`: the file holds the channels, the request or the rig's profile everything else."""

from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path

from service.api.base import Origin
from service.api.rig import FileKindName, RigProfile
from service.clutch.incoming_run import IncomingRun
from service.errors import InvalidError
from service.readers.read_file import read_file
from service.readers.table import ColumnChoice, Reading
from service.runs.channels_run import run_of
from service.runs.rig_profile import Named, named
from service.runs.suggestion import suggestion_of


def read_file_run(
    path: Path,
    *,
    filename: str,
    kind: FileKindName | None,
    cycles: float | None,
    run_id: str | None = None,
    started_at: datetime | None = None,
    origin: Origin = "measured",
    reading: Reading | None = None,
    profile: RigProfile | None = None,
    rig: str | None = None,
) -> IncomingRun:
    """The run in a file, read by a profile or the saved one of `rig` if given; explicit arguments take precedence over
    the profile.

    Raises InvalidError or TooLargeError naming what is wrong; without a profile the former has a suggestion, if there is
    one.
    """
    reading = reading_with(profile, reading or Reading())
    try:
        return _read_run(path, filename, kind, cycles, run_id, started_at, origin, reading, profile, rig)
    except InvalidError as error:
        if profile is None:
            error.suggestion = suggestion_of(
                path, filename=filename, reading=reading, kind=kind, cycles=cycles, why=error.detail
            )
        if error.suggestion is not None:
            error.detail += ". A reading is suggested: confirm it, or send the file with the right one"
        raise


def file_kind(kind: str) -> FileKindName:
    """The kind of a stored run that was sent as a file."""
    return "dynamic_stribeck" if kind == "dynamic_stribeck" else "stationary_stribeck"


def _read_run(
    path: Path,
    filename: str,
    kind: FileKindName | None,
    cycles: float | None,
    run_id: str | None,
    started_at: datetime | None,
    origin: Origin,
    reading: Reading,
    profile: RigProfile | None,
    rig: str | None,
) -> IncomingRun:
    """The run in a file: its table read, and kind, cycles and name as given or found by the rig profile."""
    read = read_file(path, filename=filename, reading=reading)
    stated = Named() if profile is None else named(profile, filename, read.labels)
    kind, cycles = kind or stated.kind, stated.cycles if cycles is None else cycles
    if kind is None or cycles is None:
        name = "kind" if kind is None else "cycles"
        where = f"the rig profile finds no {name} for {filename!r}"
        if profile is None:
            where = "no rig profile was named, which could find it"
        raise InvalidError.of(f"{name} must be given: {where}", code="missing", pointer=f"/query/{name}")
    head = IncomingRun(
        kind=kind,
        cycles=cycles,
        run_id=run_id or stated.run_id or "",
        started_at=None if started_at is None else started_at.isoformat(),
        origin=origin,
        file={"filename": filename, "rig": rig, "reading": asdict(reading)},
    )
    return run_of(read, head)


def reading_with(profile: RigProfile | None, reading: Reading) -> Reading:
    """The reading of a file by a profile; settings of `reading` take precedence."""
    if profile is None:
        return reading
    choices: dict[str, ColumnChoice] = {
        own.channel: ColumnChoice(
            column=own.title, unit=own.unit, stated=own.stated, factor=own.scale, offset=own.offset
        )
        for own in profile.columns
        if own.channel
    }
    return replace(
        reading,
        mapping=reading.mapping or choices,
        only_named=not reading.mapping,
        left_out=[own.title for own in profile.columns if not own.channel],
        table=reading.table or profile.table or "",
        decimal=reading.decimal or profile.decimal or "",
        skip_rows=reading.skip_rows or profile.skip_rows,
        missing=reading.missing or profile.missing or "",
        good=reading.good or profile.good or "",
    )
