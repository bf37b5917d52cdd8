"""A file of any format -> its table, or a run's channels: detect, find the table, choose and check.

`read_file` gives the channels, `preview_file` what a person needs to see to choose them. Formats with libraries of their own
are read by the same two steps in a process of their own (`sandbox`).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from service.errors import InvalidError
from service.readers import sandbox
from service.readers.archive import members, unpacked
from service.readers.channels import Channels, to_channels
from service.readers.column_names import parse_map
from service.readers.detect import Format, opened, sniff
from service.readers.limits import LIMITS, Limits
from service.readers.preview import preview
from service.readers.table import Reading, only
from service.readers.text import read_text

#: Files of an archive that are tried, to find the one that holds channels. Chosen; a rig's folder of one test has few.
_MAX_TRIED = 10
Read = TypeVar("Read")


def reading_of(mapping: str | None = None, **others: Any) -> Reading:
    """How to read a file, with the columns as a map's text (`torque_nm:Mz,...`)."""
    return Reading(mapping=parse_map(mapping), **others)


def read_file(path: Path, *, filename: str, reading: Reading | None = None, limits: Limits = LIMITS) -> Channels:
    """The channels [n] of a file by public name, in the channels' units, and what was noticed.

    `filename` is the sender's name for it. Raises InvalidError or TooLargeError, and nothing else, whatever the file holds;
    BusyError where the service is ending, or a reader cannot start.
    """
    reading = reading or Reading()
    kind = sniff(path, filename, limits)
    if kind is Format.ZIP:
        return _in_archive(path, reading, limits, read_file)
    if kind is not Format.TEXT:
        return sandbox.read_isolated(kind, path, reading=reading, limits=limits)
    return to_channels(read_text(partial(opened, path, limits), reading, limits), reading, limits)


def preview_file(
    path: Path, *, filename: str, reading: Reading | None = None, limits: Limits = LIMITS
) -> dict[str, Any]:
    """The table as it is read, and what each column is taken for (`preview.preview`). Raises as `read_file` does."""
    reading = reading or Reading()
    kind = sniff(path, filename, limits)
    if kind is Format.ZIP:
        return _in_archive(path, reading, limits, preview_file)
    if kind is not Format.TEXT:
        return sandbox.preview_isolated(kind, path, reading=reading, limits=limits)
    return preview(read_text(partial(opened, path, limits), reading, limits), reading)


def _in_archive(path: Path, reading: Reading, limits: Limits, read: Callable[..., Read]) -> Read:
    """What the one record in an archive holds; of several the one that `reading` names, as `file` or `file/table`."""
    names = members(path, limits)
    matching = [name for name in names if reading.table in (name, Path(name).name)]
    within = [name for name in names if reading.table.startswith(f"{name}/")]
    if len(matching) == 1:
        return _member(path, matching[0], replace(reading, table=""), limits, read)
    if within:
        return _member(path, within[0], replace(reading, table=reading.table[len(within[0]) + 1 :]), limits, read)
    records: dict[str, Read] = {}
    refused: dict[str, InvalidError] = {}
    for name in names[:_MAX_TRIED]:
        try:
            records[name] = _member(path, name, reading, limits, read)
        except InvalidError as error:
            refused[name] = error
    if not records and len(refused) == 1:
        raise next(iter(refused.values()))
    return list(records.values())[only(list(records) or names, "", "file")]


def _member(path: Path, name: str, reading: Reading, limits: Limits, read: Callable[..., Read]) -> Read:
    with unpacked(path, name, limits) as plain:
        if sniff(plain, name, limits) is Format.ZIP:
            raise InvalidError(f"{name!r} is an archive in an archive: send it by itself")
        return read(plain, filename=name, reading=reading, limits=limits)
