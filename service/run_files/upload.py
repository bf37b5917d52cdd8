"""A run posted as a file -> `IncomingRun`: the file holds the channels, the request or the rig's profile everything else."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path

from models.arrays import FloatArray
from models.records.cleaning import UnusableRecordError
from models.records.plateaus import cut_plateaus
from service.columns import PLATE_TEMPERATURES, check_columns
from service.errors import FieldError, InvalidError, Notice
from service.lives.incoming_run import IncomingRun, SampledChannels, name_run
from service.readers.channels import LEFT_OUT, Channels
from service.readers.read_file import read_file
from service.readers.table import Choice, Reading
from service.run_files.rig_profile import Named, named
from service.schemas.rig import RigProfile

#: The channels that each kind of run must have, and the channels that it may have.
NEEDED = {
    "stationary_stribeck": ("pressure_bar", "speed_rpm", "torque_nm"),
    "dynamic_stribeck": ("time_s", "pressure_bar", "speed_rpm", "torque_nm"),
}
_ALLOWED = {
    "stationary_stribeck": ("time_s", "oil_temperature_c", *PLATE_TEMPERATURES, "torque_sd_nm"),
    "dynamic_stribeck": ("oil_temperature_c", *PLATE_TEMPERATURES),
}


def read_file_run(
    path: Path,
    *,
    filename: str,
    kind: str | None,
    cycles: float | None,
    run_id: str | None = None,
    started_at: datetime | None = None,
    origin: str = "measured",
    reading: Reading | None = None,
    profile: RigProfile | None = None,
    rig: str | None = None,
) -> IncomingRun:
    """The run in a file, read by a profile, the stored one of `rig`, where one is given; what is given beside it wins.

    Raises InvalidError or TooLargeError naming what is wrong.
    """
    reading = reading_with(profile, reading or Reading())
    read = read_file(path, filename=filename, reading=reading)
    stated = Named() if profile is None else named(profile, filename, read.labels)
    kind, cycles = kind or stated.kind, stated.cycles if cycles is None else cycles
    if kind is None or cycles is None:
        name = "kind" if kind is None else "cycles"
        where = (
            "no rig profile was named, which could find it"
            if profile is None
            else f"the rig profile finds no {name} for {filename!r}"
        )
        message = f"{name} must be given: {where}"
        raise InvalidError.of(message, code="missing", pointer=f"/query/{name}")
    run = run_of(
        read,
        kind=kind,
        cycles=cycles,
        run_id=run_id or stated.run_id,
        started_at=None if started_at is None else started_at.isoformat(),
        origin=origin,
    )
    file = {"filename": filename, "rig": rig, "reading": asdict(reading)}
    return replace(run, file=file | dict(run.file or {}))


def run_of(
    read: Channels,
    *,
    kind: str,
    cycles: float,
    run_id: str | None = None,
    started_at: str | None = None,
    origin: str = "measured",
) -> IncomingRun:
    """The run of that kind in channels as they were read. Raises InvalidError where they do not make one."""
    columns, notices = read.columns, list(read.notices)
    missing = [name for name in NEEDED[kind] if name not in columns]
    if missing:
        errors = [
            FieldError(pointer=f"/channels/{name}", code="missing", message=f"the file has no channel {name}")
            for name in missing
        ]
        present = ", ".join(columns) or "none"
        raise InvalidError(
            f"a {kind} run needs {', '.join(missing)}; channels found: {present}{_way_out(missing[0], notices)}",
            errors=errors,
        )
    if kind == "stationary_stribeck" and read.counts and _holds_no_dwell(columns):
        message = (
            "the times in the file only count the rows, so each row was read as a plateau. If the rows are samples, send "
            "the samples' times"
        )
        notices.append(Notice(code="counting_clock", message=message))
        columns = {name: column for name, column in columns.items() if name != "time_s"}
        check_columns(columns)  # a plateau has no negative pressure, which a sample may have
    accepted = (*NEEDED[kind], *_ALLOWED[kind])
    run = IncomingRun(
        kind=kind,
        cycles=cycles,
        run_id=run_id or "",
        started_at=started_at,
        origin=origin,
        channels={name: column for name, column in columns.items() if name in accepted},
        file={"warnings": [asdict(notice) for notice in notices]},
    )
    return name_run(run)


def reading_with(profile: RigProfile | None, reading: Reading) -> Reading:
    """How a file is read by a profile; what `reading` says itself wins."""
    if profile is None:
        return reading
    choices: dict[str, Choice] = {
        column.channel: Choice(
            column=column.title, unit=column.unit, stated=column.stated, factor=column.scale, offset=column.offset
        )
        for column in profile.columns
        if column.channel
    }
    return replace(
        reading,
        mapping=reading.mapping or choices,
        only_named=not reading.mapping,
        table=reading.table or profile.table or "",
        decimal=reading.decimal or profile.decimal or "",
        skip_rows=reading.skip_rows or profile.skip_rows,
        missing=reading.missing or profile.missing or "",
    )


def _way_out(channel: str, notices: Sequence[Notice]) -> str:
    """What helps where a column that was left out may be the missing channel."""
    left_out = next((notice.message for notice in notices if notice.code == LEFT_OUT), "")
    return f"; {left_out}; choose one of them with map={channel}:NAME" if left_out else ""


def _holds_no_dwell(columns: Mapping[str, FloatArray]) -> bool:
    """Whether a record by its times is no test: nothing in it stays as it is for a while."""
    try:
        cut_plateaus(SampledChannels(columns))
    except UnusableRecordError:
        return True
    return False
