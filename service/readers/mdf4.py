"""ASAM MDF4 -> columns, by asammdf: channels of all groups in physical values, the groups' master channel as the time.

Runs in the reading process of `isolation`. Source: ASAM MDF 4.2, Measurement Data Format.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks import v4_constants as v4c

from models.arrays import FloatArray
from service.errors import FieldError, InvalidError
from service.readers.column_names import Header, Taken, choose, parse_map
from service.readers.limits import Limits
from service.readers.recorder_columns import numbers, place, recorded_header, require_one_length

_TRUNCATED = "truncated"


@dataclass(frozen=True, slots=True)
class _Found:
    header: Header
    group: int
    index: int
    rows: int


def read(path: Path, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The channels [n] that the map and the names tell, in their own units; `time_s` from the master channel."""
    _require_version_4(path)
    with MDF(path) as file:
        asked = parse_map(mapping)
        found = _channels(file, masters="time_s" in asked)
        if len(found) > limits.most_columns:
            raise InvalidError(f"a file must not have more than {limits.most_columns} channels, got {len(found)}")
        headers = [each.header for each in found]
        taken = choose(headers, mapping)
        require_one_length({place(headers, each): found[each.index].rows for each in taken}, limits)
        columns = {each.channel: _column(file, each, found[each.index]) for each in taken}
        if "time_s" not in columns:
            columns |= _master(file, [found[each.index] for each in taken])
        return columns


def _require_version_4(path: Path) -> None:
    with path.open("rb") as file:
        version = file.read(16)[8:].decode("latin-1").strip("\0 ")
    if not version.startswith("4"):
        raise InvalidError(f"an MDF file must be of version 4, got {version!r}")


def _channels(file: Any, *, masters: bool) -> list[_Found]:
    """All channels with values; the master channels among them only where a map asks for one by name."""
    groups = [index for index, group in enumerate(file.groups) if group.channel_group.cycles_nr]
    found = []
    for group in groups:
        name = (file.groups[group].channel_group.acq_name or f"group {group}") if len(groups) > 1 else ""
        for index, channel in enumerate(file.groups[group].channels):
            if masters or index != file.masters_db.get(group):
                header = recorded_header(channel.name, file.get_channel_unit(group=group, index=index), name)
                found.append(_Found(header, group, index, int(file.groups[group].channel_group.cycles_nr)))
    return found


def _column(file: Any, each: Taken, found: _Found) -> FloatArray:
    samples = file.get(group=found.group, index=found.index).samples
    if len(samples) != found.rows:
        message = f"{each.channel} must have the {found.rows} rows that its group states, got {len(samples)}"
        raise InvalidError(message, errors=[FieldError(pointer="", code=_TRUNCATED, message=message)])
    column = numbers(each.channel, samples).copy()
    each.conversion.apply(column)
    return column


def _master(file: Any, found: list[_Found]) -> dict[str, FloatArray]:
    """`time_s` of the groups that were taken, which must have one time; nothing where they have none.

    A master that is an angle, a distance or an index is no time.
    """
    groups = sorted({each.group for each in found})
    timed = [group for group in groups if group in file.masters_db and _is_time(file, group)]
    times = [np.array(file.get_master(group), dtype=np.float64) for group in timed]
    if not times:
        return {}
    if len(times) < len(groups) or any(not np.array_equal(times[0], time) for time in times[1:]):
        raise InvalidError("all channels that are taken must be sampled by one clock, got groups whose times differ")
    return {"time_s": times[0]}


def _is_time(file: Any, group: int) -> bool:
    master = file.groups[group].channels[file.masters_db[group]]
    return master.sync_type not in (v4c.SYNC_TYPE_ANGLE, v4c.SYNC_TYPE_DISTANCE, v4c.SYNC_TYPE_INDEX)
