"""NI TDMS -> a table, by npTDMS: channels of all groups, scaled, units from `unit_string`, each with its waveform's clock.

Runs in the reading process of `sandbox`. Source: NI, TDMS File Format Internal Structure; Waveform properties (wf_*).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile  # type: ignore[import-untyped]
from numpy.typing import NDArray

from service.errors import MAX_QUOTED, InvalidError
from service.readers.arrays import refuse_counts, unit_of_array
from service.readers.column_names import column_of
from service.readers.constants import in_parts, refuse_several_tests
from service.readers.limits import Limits
from service.readers.numerals import Stamps, is_stamp
from service.readers.stated_clocks import evenly, in_seconds, stated_clock
from service.readers.table import Clock, FileColumn, Reading, Table, cut_short, index_of_wanted
from service.readers.unit_table import conversion

#: Kinds of scales that npTDMS computes.
_SCALES = {
    "Linear", "Polynomial", "Table", "RTD", "Strain", "Thermistor", "Thermocouple", "Add", "Subtract", "AdvancedAPI",
}  # fmt: skip
_SECOND = np.timedelta64(1, "s")


def read_table(path: Path, reading: Reading, limits: Limits) -> Table:
    """The channels of all groups, or of the named one. Raises InvalidError on a file that is cut off."""
    file = TdmsFile.open(path)
    if file.file_status.incomplete_final_segment:
        raise cut_short("its last TDMS segment is not complete")
    groups = [group for group in file.groups() if any(len(channel) for channel in group.channels())]
    if reading.reads_all():
        return in_parts([_table(file, [group], group.name, limits) for group in groups])
    if reading.table:
        groups = [groups[index_of_wanted([group.name for group in groups], reading.table, "group")]]
    table = _table(file, groups, reading.table, limits)
    refuse_several_tests(table.columns)
    return table


def _table(file: Any, groups: Sequence[Any], name: str, limits: Limits) -> Table:
    """The channels of some groups."""
    channels = [channel for group in groups for channel in group.channels() if len(channel)]
    limits.require_columns(len(channels))
    scales = [_scales(channel) for channel in channels]
    group_properties = {group.name: _stated({**file.properties, **group.properties}) for group in groups}
    starts = [channel.properties.get("wf_start_time") for channel in channels]
    earliest = min((start for start in starts if start is not None), default=None)
    stamps = Stamps({}, set())
    clocks = [
        _waveform(channel, earliest)
        or stated_clock(
            group_properties[channel.group_name] | _stated(channel.properties), partial(len, channel), stamps
        )
        for channel in channels
    ]

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        values_by_index = {index: _scaled(channels[index], scales[index]) for index in taken}
        for index, values in values_by_index.items():
            refuse_counts(channels[index].name[:MAX_QUOTED], values, _stated(channels[index].properties))
        return list(values_by_index.values())

    columns = tuple(_column(channel, len(groups) > 1, clock) for channel, clock in zip(channels, clocks, strict=True))
    others = tuple(group.name for group in file.groups())
    above = (
        tuple((key, f"{value}") for key, value in group_properties[groups[0].name].items()) if len(groups) == 1 else ()
    )
    return Table(columns=columns, read=read, name=name, others=others, above=above)


def _scales(channel: Any) -> dict[str, str]:
    """The kinds of scales still to be applied to a channel, by the prefixes of their properties' names.

    npTDMS takes a polynomial without a size for one of four coefficients: they are counted here.
    """
    stated = channel.properties
    if stated.get("NI_Scaling_Status") == "scaled":
        return {}
    kinds = {key: str(kind) for key, kind in stated.items() if re.fullmatch(r"NI_Scale\[\d+\]_Scale_Type", key)}
    for of in (key.replace("Scale_Type", "Polynomial_Coefficients") for key in kinds if kinds[key] == "Polynomial"):
        stated.setdefault(f"{of}_Size", sum(other.startswith(f"{of}[") for other in stated))
    return kinds


def _scaled(channel: Any, scales: Mapping[str, str]) -> NDArray[Any]:
    """A channel's physical values; raises InvalidError on a scale for which npTDMS would give raw counts."""
    if unknown := set(scales.values()) - _SCALES:
        name, kind = channel.name[:MAX_QUOTED], min(unknown)[:MAX_QUOTED]
        message = f"{name} has the scale {kind!r}, which the service cannot apply: save the physical values"
        raise InvalidError.of(message, code="raw_counts")
    values: NDArray[Any] = channel[:]
    return values


def _stated(properties: Mapping[str, Any]) -> dict[str, float | str]:
    """The properties of a file, a group or a channel, without those of the waveform."""
    return {
        str(name): value
        for name, value in properties.items()
        if isinstance(value, float | int | str) and not str(name).startswith("wf_")
    }


def _column(channel: Any, grouped: bool, clock: Clock | None) -> FileColumn:
    kind = "" if channel.dtype is None else channel.dtype.kind
    moments = kind == "M" or (kind in "OSU" and is_stamp(str(channel[0])))
    group = channel.group_name if grouped else ""
    column = column_of(channel.name, unit_of_array(channel.properties) or None, group, moments=moments)
    return replace(column, rows=len(channel), clock=clock)


def _waveform(channel: Any, earliest: Any) -> Clock | None:
    """A waveform's clock: wf_start_time + wf_start_offset + k · wf_increment, in s after the earliest start of all.

    One whose properties say that it has a single sample a waveform (wf_samples 1), or whose axis is no time, has none.
    """
    properties, start = channel.properties, channel.properties.get("wf_start_time")
    step, offset = (float(properties.get(name, 0.0)) for name in ("wf_increment", "wf_start_offset"))
    if not step > 0 or (properties.get("wf_samples") == 1 and step == 1.0) or channel.dtype is None:
        return None
    unit = str(properties.get("wf_xunit_string") or "s").strip()
    axis = str(properties.get("wf_xname") or "").strip().lower()
    if axis not in ("", "time") and conversion("time_s", unit) is None:
        return None
    factor = in_seconds(1.0, unit, f"the times of {channel.name}")
    shift = 0.0 if start is None else float((np.datetime64(start) - np.datetime64(earliest)) / _SECOND)
    rows = len(channel)
    # a waveform without a start cannot be told from the others' start: its own key keeps it from passing for theirs
    key = (None if start is None and earliest is not None else shift, offset * factor, step * factor, rows)
    read = partial(evenly, shift + offset * factor, step * factor, rows)
    return Clock(key, read, counts=step == 1.0 and offset == 0.0)
