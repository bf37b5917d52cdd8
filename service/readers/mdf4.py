"""ASAM MDF4 -> a table, by asammdf: channels of all groups in physical values, each with the clock of its group's master.

Runs in the reading process of `sandbox`. Source: ASAM MDF 4.2, Measurement Data Format.
"""

import shutil
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks import v4_constants as v4c
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers.column_names import choices_of, column_of
from service.readers.constants import refuse_several_tests
from service.readers.limits import Limits
from service.readers.stated_clocks import in_seconds
from service.readers.table import Clock, FileColumn, Reading, Table, cut_short

#: Conversions that refer to each other, at most. Chosen: recorders refer once.
_DEEPEST_CONVERSION = 8
#: What a group's master may be instead of a time.
_NO_TIMES = (v4c.SYNC_TYPE_ANGLE, v4c.SYNC_TYPE_DISTANCE, v4c.SYNC_TYPE_INDEX)


def read_table(path: Path, reading: Reading, limits: Limits) -> Table:
    """The channels of all groups. A file that was not finalised is finalised in a copy by asammdf."""
    with path.open("rb") as opened:
        head = opened.read(16)
    version = head[8:].decode("latin-1").strip("\0 ")
    if not version.startswith("4"):
        raise InvalidError(f"an MDF file must be of version 4, got {version!r}: convert it with asammdf (MDF.convert)")
    shutil.copy = shutil.copyfile  # asammdf's copy for finalising also sets the mode, which this process may not
    # a file that is not mapped into memory takes less of it; what has to be finalised is copied by its path
    file = MDF(path if head.startswith(b"UnFinMF") else path.open("rb"))
    masters = "time_s" in choices_of(reading)  # a map may name a master channel for the time
    places = list(_places(file, masters=masters, table=reading.table))
    limits.require_columns(len(places))

    clocks: dict[int, FloatArray] = {}

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        return _values(file, {places[index]: channel for index, channel in taken.items()}, clocks)

    notices = []
    if head.startswith(b"UnFinMF"):
        message = "the recorder did not close the MDF4 file: all rows up to its end were read"
        notices.append(Notice(code="not_finalised", message=message))
    several = len({group for group, _ in places}) > 1
    columns = tuple(_column(file, group, index, several, clocks) for group, index in places)
    refuse_several_tests(columns)
    names = tuple(dict.fromkeys(_name(file, group) for group, _ in places))
    return Table(columns=columns, read=read, name=reading.table, others=names, notices=tuple(notices))


def _places(file: Any, *, masters: bool, table: str) -> Iterator[tuple[int, int]]:
    """Group and index of all channels with values."""
    for group, channel_group in enumerate(file.groups):
        if channel_group.channel_group.cycles_nr and table in ("", _name(file, group)):
            for index in range(len(channel_group.channels)):
                if masters or index != file.masters_db.get(group):
                    yield group, index


def _name(file: Any, group: int) -> str:
    return str(file.groups[group].channel_group.acq_name or f"group {group}")


def _column(file: Any, group: int, index: int, several: bool, clocks: Mapping[int, FloatArray]) -> FileColumn:
    rows = int(file.groups[group].channel_group.cycles_nr)
    name = _name(file, group) if several else ""
    unit = file.get_channel_unit(group=group, index=index)
    channels = file.groups[group].channels
    column, master = column_of(channels[index].name, unit, name), file.masters_db.get(group)
    timed = master is not None and channels[master].sync_type not in _NO_TIMES
    return replace(column, rows=rows, clock=Clock(group, partial(_times, file, group, clocks)) if timed else None)


def _times(file: Any, group: int, clocks: Mapping[int, FloatArray]) -> FloatArray:
    """The times of a group [n] s, from `clocks` if they were read with its values. Raises InvalidError if their unit is
    unknown."""
    master = file.masters_db[group]
    _refuse_formula(file, group, master)
    unit = str(file.get_channel_unit(group=group, index=master) or "s")
    factor = in_seconds(1.0, unit, f"the times of {_name(file, group)}")
    held = np.asarray(clocks[group] if group in clocks else file.get_master(group), dtype=np.float64)
    return held if factor == 1 else factor * held


def _values(file: Any, channels: Mapping[tuple[int, int], str], clocks: dict[int, FloatArray]) -> list[NDArray[Any]]:
    """The physical values of channels by group and index, masked if their recorder marks them invalid; the groups'
    times are put into `clocks`. Each group is read once."""
    for group, index in channels:
        _refuse_formula(file, group, index)
    read = []
    signals = file.select([(None, *place) for place in channels], copy_master=False)
    for (place, channel), signal in zip(channels.items(), signals, strict=True):
        rows = int(file.groups[place[0]].channel_group.cycles_nr)
        if len(signal.samples) != rows:
            raise cut_short(f"{channel} has {len(signal.samples)} rows, and the file states {rows}")
        clocks[place[0]] = signal.timestamps
        invalid = signal.invalidation_bits
        masked = invalid is not None
        read.append(
            np.ma.MaskedArray(signal.samples, mask=np.asarray(invalid, dtype=np.bool_)) if masked else signal.samples
        )
    return read


def _refuse_formula(file: Any, group: int, index: int) -> None:
    """Raise InvalidError if the values of a channel to be read, or of its time, are computed by a formula in the file.

    asammdf has a formula computed by numexpr, by sympy as Python where that is installed, and gives raw counts where neither
    can: a file from outside decides neither what is run here nor what passes for a torque.
    """
    channel = file.groups[group].channels[index]
    if _has_formula(channel.conversion):
        message = (
            f"{channel.name[:MAX_QUOTED]} needs a formula (MDF4 algebraic conversion), which the service does not compute: "
            "record it with a linear, rational or tabular conversion, or export its physical values"
        )
        raise InvalidError.of(message, code="algebraic_conversion")


def _has_formula(conversion: Any, depth: int = 0) -> bool:
    """Whether a conversion, or one to which it refers, is or may be a formula; too deep references may be."""
    if conversion is None or isinstance(conversion, bytes):
        return False
    referenced = (conversion.referenced_blocks or {}).values()
    if conversion.conversion_type == v4c.CONVERSION_TYPE_ALG or depth > _DEEPEST_CONVERSION:
        return True
    return any(_has_formula(block, depth + 1) for block in referenced)
