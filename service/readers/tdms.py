"""NI TDMS -> columns, by npTDMS: channels of all groups, scaled, units from `unit_string`, time from the waveform.

Runs in the reading process of `sandbox`. Source: NI, TDMS File Format Internal Structure.
"""

from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile  # type: ignore[import-untyped]

from models.arrays import FloatArray
from service.errors import FieldError, InvalidError
from service.readers.column_names import Taken, choose
from service.readers.limits import Limits
from service.readers.recorder_columns import numbers, place, recorded_header, require_one_length

_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit")


def read(path: Path, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The channels [n] that the map and the names choose, in their own units.

    A waveform's time, wf_start_offset + k · wf_increment, becomes `time_s` where the file has no time channel.
    """
    with TdmsFile.open(path) as file:
        if file.file_status.incomplete_final_segment:
            message = "the TDMS file is cut off: its last segment is not complete"
            raise InvalidError(message, errors=[FieldError(pointer="", code="truncated", message=message)])
        groups = file.groups()
        channels = [channel for group in groups for channel in group.channels() if len(channel)]
        if len(channels) > limits.most_columns:
            raise InvalidError(f"a file must not have more than {limits.most_columns} channels, got {len(channels)}")
        headers = [
            recorded_header(channel.name, _unit(channel), channel.group_name if len(groups) > 1 else "")
            for channel in channels
        ]
        taken = choose(headers, mapping)
        require_one_length({place(headers, column): len(channels[column.index]) for column in taken}, limits)
        columns = {}
        for column in taken:
            values = numbers(column.channel, channels[column.index][:])
            if channels[column.index].dtype.kind != "M":
                column.conversion.apply(values)
            columns[column.channel] = values
        if "time_s" not in columns:
            columns |= _waveform_time(channels, taken)
        return columns


def _unit(channel: Any) -> str | None:
    """The unit that a channel's properties state; points in time need none."""
    if channel.dtype is not None and channel.dtype.kind == "M":
        return "s"
    return next((str(channel.properties[name]) for name in _UNITS if channel.properties.get(name)), None)


def _waveform_time(channels: list[Any], taken: list[Taken]) -> dict[str, FloatArray]:
    """`time_s` of waveforms that share one clock; empty where there are none. Raises InvalidError on several clocks."""
    clocks = {
        (
            float(channels[column.index].properties.get("wf_start_offset", 0.0)),
            float(channels[column.index].properties.get("wf_increment", 0.0)),
        )
        for column in taken
    }
    if len(clocks) > 1:
        shown = ", ".join(f"{step:g} s" for step in sorted({step for _, step in clocks}))
        raise InvalidError(
            f"all channels must be sampled by one clock, got different offsets or steps (wf_increment): {shown}"
        )
    offset, step = clocks.pop()
    return {"time_s": offset + step * np.arange(len(channels[taken[0].index]), dtype=np.float64)} if step > 0 else {}
