"""ASAM MDF4 -> columns, by asammdf: channels of all groups in physical values, the groups' master channel as the time.

Runs in the reading process of `sandbox`. Source: ASAM MDF 4.2, Measurement Data Format.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks import v4_constants as v4c

from models.arrays import FloatArray
from service.errors import MOST_QUOTED, FieldError, InvalidError
from service.readers.column_names import Header, Taken, choose, parse_map
from service.readers.limits import Limits
from service.readers.recorder_columns import numbers, place, recorded_header, require_one_length

_TRUNCATED = "truncated"
#: Conversions that refer to each other, at most. Chosen: recorders refer once.
_DEEPEST_CONVERSION = 8


@dataclass(frozen=True, slots=True)
class _Source:
    """A channel of the file: its header, where it is, and how many rows its group states."""

    header: Header
    group: int
    index: int
    rows: int


def read(path: Path, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The channels [n] that the map and the names choose, in their own units; `time_s` from the master channel."""
    _require_version_4(path)
    with MDF(path) as file:
        sources = _sources(file, masters="time_s" in parse_map(mapping))
        if len(sources) > limits.most_columns:
            raise InvalidError(f"a file must not have more than {limits.most_columns} channels, got {len(sources)}")
        headers = [source.header for source in sources]
        taken = choose(headers, mapping)
        for column in taken:
            _refuse_formula(file, headers[column.index], sources[column.index])
        require_one_length({place(headers, column): sources[column.index].rows for column in taken}, limits)
        columns = {column.channel: _values(file, column, sources[column.index]) for column in taken}
        if "time_s" not in columns:
            columns |= _master_time(file, [sources[column.index] for column in taken])
        return columns


def _require_version_4(path: Path) -> None:
    with path.open("rb") as file:
        version = file.read(16)[8:].decode("latin-1").strip("\0 ")
    if not version.startswith("4"):
        raise InvalidError(f"an MDF file must be of version 4, got {version!r}")


def _sources(file: Any, *, masters: bool) -> list[_Source]:
    """All channels with values; `masters`: master channels too, for a map that names the time."""
    groups = [index for index, group in enumerate(file.groups) if group.channel_group.cycles_nr]
    sources = []
    for group in groups:
        name = (file.groups[group].channel_group.acq_name or f"group {group}") if len(groups) > 1 else ""
        for index, channel in enumerate(file.groups[group].channels):
            if masters or index != file.masters_db.get(group):
                header = recorded_header(channel.name, file.get_channel_unit(group=group, index=index), name)
                sources.append(_Source(header, group, index, int(file.groups[group].channel_group.cycles_nr)))
    return sources


def _refuse_formula(file: Any, header: Header, source: _Source) -> None:
    """Raise InvalidError where a formula in the file makes the values of a channel that is taken, or of its time.

    asammdf has a formula computed by numexpr, by sympy as Python where that is installed, and gives raw counts where neither
    can: a file from outside decides neither what is run here nor what passes for a torque.
    """
    channels = file.groups[source.group].channels
    for index in {source.index, file.masters_db.get(source.group, source.index)}:
        if _has_formula(channels[index].conversion):
            name = header.shown() if index == source.index else channels[index].name[:MOST_QUOTED]
            message = (
                f"{name} is converted by a formula (MDF4 algebraic conversion), which is not computed here: record "
            )
            message += "it with a linear, rational or tabular conversion, or export its physical values"
            raise InvalidError(message, errors=[FieldError(pointer="", code="algebraic_conversion", message=message)])


def _has_formula(conversion: Any, depth: int = 0) -> bool:
    """Whether a conversion, or one that it refers to, is a formula; one that refers too deeply may be."""
    if conversion is None or isinstance(conversion, bytes):
        return False
    referenced = (conversion.referenced_blocks or {}).values()
    if conversion.conversion_type == v4c.CONVERSION_TYPE_ALG or depth > _DEEPEST_CONVERSION:
        return True
    return any(_has_formula(block, depth + 1) for block in referenced)


def _values(file: Any, column: Taken, source: _Source) -> FloatArray:
    samples = file.get(group=source.group, index=source.index).samples
    if len(samples) != source.rows:
        message = f"{column.channel} must have the {source.rows} rows that its group states, got {len(samples)}"
        raise InvalidError(message, errors=[FieldError(pointer="", code=_TRUNCATED, message=message)])
    values = numbers(column.channel, samples).copy()
    column.conversion.apply(values)
    return values


def _master_time(file: Any, sources: list[_Source]) -> dict[str, FloatArray]:
    """`time_s` of the groups that were taken, which must agree; empty where no master channel is a time.

    A master channel may also be an angle, a distance or an index.
    """
    groups = sorted({source.group for source in sources})
    timed = [group for group in groups if group in file.masters_db and _is_time(file, group)]
    times = [np.array(file.get_master(group), dtype=np.float64) for group in timed]
    if not times:
        return {}
    if len(times) < len(groups) or any(not np.array_equal(times[0], time) for time in times[1:]):
        raise InvalidError("all channels that are taken must be sampled by one clock, got groups with different times")
    return {"time_s": times[0]}


def _is_time(file: Any, group: int) -> bool:
    master = file.groups[group].channels[file.masters_db[group]]
    return master.sync_type not in (v4c.SYNC_TYPE_ANGLE, v4c.SYNC_TYPE_DISTANCE, v4c.SYNC_TYPE_INDEX)
