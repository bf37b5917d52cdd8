"""The channels of a file as a run of its kind: what each must have, and whether rows are samples or plateaus."""

from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from models.arrays import FloatArray
from models.records.cleaning import UnusableRecordError
from models.records.plateaus import cut_plateaus
from service.channels import PLATE_TEMPERATURES, check_columns
from service.clutch.incoming_run import IncomingRun, SampledChannels, name_run
from service.errors import FieldError, InvalidError, Notice
from service.readers.assemble import LEFT_OUT, Channels
from service.readers.table import NO_TIME

#: The channels that each kind of run must have, and the channels that it may have.
NEEDED = {
    "stationary_stribeck": ("pressure_bar", "speed_rpm", "torque_nm"),
    "dynamic_stribeck": ("time_s", "pressure_bar", "speed_rpm", "torque_nm"),
}
_ALLOWED = {
    "stationary_stribeck": ("time_s", "oil_temperature_c", *PLATE_TEMPERATURES, "torque_sd_nm"),
    "dynamic_stribeck": ("oil_temperature_c", *PLATE_TEMPERATURES),
}
#: A step between rows that is none between samples of plateaus, s. Chosen: records have at least 10 Hz.
_LONGEST_STEP = 1.0


def run_of(read: Channels, head: IncomingRun) -> IncomingRun:
    """The run with the channels that were read. Raises InvalidError where they do not make one of its kind."""
    kind, columns, notices = head.kind, read.columns, list(read.notices)
    missing = [name for name in NEEDED[kind] if name not in columns]
    if missing:
        errors = [
            FieldError(pointer=f"/channels/{name}", code="missing", message=f"the file has no channel {name}")
            for name in missing
        ]
        message = f"a {kind} run needs {', '.join(missing)}; channels found: {', '.join(columns) or 'none'}"
        # a column that was left out may be the missing channel
        if left_out := next((notice.message for notice in notices if notice.code == LEFT_OUT), ""):
            message += f"; {left_out}; choose one of them with map={missing[0]}:NAME"
        if missing == ["time_s"]:
            message += ". If the rows were sampled at a steady rate, state it with map=time_s:=100 Hz"
        raise InvalidError(message, errors=errors)
    if kind == "stationary_stribeck" and read.counts and holds_no_dwell(columns):
        message = (
            "the times in the file only count the rows, so each row was read as a plateau. If the rows are samples, send "
            "the samples' times"
        )
        notices.append(Notice(code="counting_clock", message=message))
        columns = {name: column for name, column in columns.items() if name != "time_s"}
        check_columns(columns)  # a plateau has no negative pressure, which a sample may have
    accepted = (*NEEDED[kind], *_ALLOWED[kind])
    if kind == "stationary_stribeck" and slower_than_samples(columns):
        message = (
            "the rows are too far apart in time for samples of plateaus: if each row is a plateau, send time=none; if they "
            "are samples, send them at the rate at which they were taken"
        )
        raise InvalidError.of(message, code="rows_are_plateaus", pointer="/time", value=NO_TIME)
    channels = {name: column for name, column in columns.items() if name in accepted}
    file = {**(head.file or {}), "warnings": [asdict(notice) for notice in notices]}
    return name_run(replace(head, channels=channels, file=file))


def slower_than_samples(columns: Mapping[str, FloatArray]) -> bool:
    """Whether rows by their times are plateaus themselves: too far apart to be samples of some."""
    time_s = columns.get("time_s")
    slow = time_s is not None and time_s.size > 1 and float(np.median(np.diff(time_s))) >= _LONGEST_STEP
    return slow and holds_no_dwell(columns)


def holds_no_dwell(columns: Mapping[str, FloatArray]) -> bool:
    """Whether a record by its times is no stationary test: nothing in it stays as it is for a while."""
    try:
        cut_plateaus(SampledChannels(columns))
    except UnusableRecordError:
        return True
    return False
