"""A run posted as a file -> `IncomingRun`: the file holds the channels, the request or the rig's profile everything else."""

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from service.columns import PLATE_TEMPERATURES
from service.errors import FieldError, InvalidError
from service.lives.incoming_run import IncomingRun, name_run
from service.readers.read_file import read_file
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
    mapping: str | None = None,
    profile: RigProfile | None = None,
    rig: str | None = None,
) -> IncomingRun:
    """The run in a file, read by a profile, the stored one of `rig`, where one is given; what is given beside it wins.

    Raises InvalidError or TooLargeError naming what is wrong.
    """
    columns = read_file(path, filename=filename, mapping=_mapping(profile, mapping))
    stated = Named() if profile is None else named(profile, filename, {})
    kind, cycles = kind or stated.kind, stated.cycles if cycles is None else cycles
    if kind is None or cycles is None:
        name = "kind" if kind is None else "cycles"
        where = "no rig was named" if profile is None else f"the rig's profile finds none for {filename!r}"
        message = f"{name} must be given: {where}"
        raise InvalidError(message, errors=[FieldError(pointer=f"/query/{name}", code="missing", message=message)])
    missing = [name for name in NEEDED[kind] if name not in columns]
    if missing:
        errors = [
            FieldError(pointer=f"/channels/{name}", code="missing", message=f"the file has no channel {name}")
            for name in missing
        ]
        present = ", ".join(columns) or "none"
        raise InvalidError(f"a {kind} run needs {', '.join(missing)}; channels found: {present}", errors=errors)
    accepted = (*NEEDED[kind], *_ALLOWED[kind])
    reading: dict[str, Any] = {} if profile is None else profile.model_dump(mode="json", include=_OF_READING)
    run = name_run(
        kind=kind,
        cycles=cycles,
        run_id=run_id or stated.run_id,
        started_at=None if started_at is None else started_at.isoformat(),
        origin=origin,
        channels={name: column for name, column in columns.items() if name in accepted},
        details={},
    )
    return replace(run, file={"filename": filename, "rig": rig, "reading": reading | {"map": mapping}, "warnings": []})


#: What a profile says of reading the table itself.
_OF_READING = {"columns", "decimal", "table", "skip_rows"}


def _mapping(profile: RigProfile | None, mapping: str | None) -> str | None:
    if profile is None or mapping is not None:
        return mapping
    return ",".join(f"{column.channel}:{column.title}" for column in profile.columns if column.channel)
