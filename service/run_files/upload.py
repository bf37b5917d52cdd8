"""A run posted as a file -> `IncomingRun`: the file holds the channels, the request's parameters everything else."""

from datetime import datetime
from pathlib import Path

from service.columns import PLATE_TEMPERATURES
from service.errors import FieldError, InvalidError
from service.lives.incoming_run import IncomingRun, name_run
from service.readers.read_file import read_file

#: The channels that each kind of run must have, and the channels that it may have.
_NEEDED = {
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
    kind: str,
    cycles: float,
    run_id: str | None = None,
    started_at: datetime | None = None,
    origin: str = "measured",
    mapping: str | None = None,
) -> IncomingRun:
    """The run in a CSV, TDMS, MDF4 or Parquet file; raises InvalidError or TooLargeError naming what is wrong."""
    columns = read_file(path, filename=filename, mapping=mapping)
    missing = [name for name in _NEEDED[kind] if name not in columns]
    if missing:
        errors = [
            FieldError(pointer=f"/channels/{name}", code="missing", message=f"the file has no channel {name}")
            for name in missing
        ]
        present = ", ".join(columns) or "none"
        raise InvalidError(f"a {kind} run needs {', '.join(missing)}; channels found: {present}", errors=errors)
    accepted = (*_NEEDED[kind], *_ALLOWED[kind])
    return name_run(
        kind=kind,
        cycles=cycles,
        run_id=run_id,
        started_at=None if started_at is None else started_at.isoformat(),
        origin=origin,
        channels={name: column for name, column in columns.items() if name in accepted},
        details={},
    )
