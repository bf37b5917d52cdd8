"""A file of any format -> its table, or a run's channels: detect, find the table, choose and check.

`read_file` gives the channels, `preview_file` what a person needs to see to choose them. Formats with libraries of their own
are read by the same two steps in a process of their own (`sandbox`).
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePath
from typing import Any

from service.channels import CHANNELS
from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers import sandbox
from service.readers.assemble import Channels, below_each_other
from service.readers.column_names import parse_map
from service.readers.constants import beside_each_other, value_of_part
from service.readers.detect import Format, members, opened, sniff, unpacked
from service.readers.limits import LIMITS, Limits
from service.readers.preview import ShownTable
from service.readers.suggest import Proposal
from service.readers.table import ALL, SHEETS, ColumnChoice, Reading, Table, index_of_wanted
from service.readers.text import read_text

#: Files of an archive that are tried, to find the one that holds channels. Chosen; a rig's folder of one test has few.
_MAX_TRIED = 10
#: The confidence that files of one archive are parts of one test. Chosen.
_ALL = 0.8
#: What is wrong with a file beside the records of an archive, such as a note.
_NO_PART = ("no_header", "no_such_column", "title_too_long")


def reading_of(mapping: str | None = None, **others: Any) -> Reading:
    """The way to read a file, with the columns given as a map's text (`torque_nm:Mz,...`)."""
    return Reading(mapping=parse_map(mapping), **others)


def read_file(path: Path, *, filename: str, reading: Reading | None = None, limits: Limits = LIMITS) -> Channels:
    """The channels [n] of a file by public name, in the channels' units, and notices from reading.

    `filename` is the sender's name for it. Raises InvalidError or TooLargeError, and nothing else, whatever the file holds;
    BusyError where the service is ending, or a reader cannot start.
    """
    channels: Channels = _read(path, filename, reading or Reading(), limits, "channels")
    return channels


def preview_file(path: Path, *, filename: str, reading: Reading | None = None, limits: Limits = LIMITS) -> ShownTable:
    """The preview of a file's table, with each column's channel (`preview.preview`). Raises as `read_file` does."""
    shown: ShownTable = _read(path, filename, reading or Reading(), limits, "preview")
    return shown


def suggest_file(path: Path, *, filename: str, reading: Reading, limits: Limits = LIMITS) -> Proposal | None:
    """A suggested way to read an ambiguous file (`suggest.propose`). Raises as `read_file` does."""
    proposed: Proposal | None = _read(path, filename, reading, limits, "suggestion")
    return proposed


def _read(path: Path, filename: str, reading: Reading, limits: Limits, answer: sandbox.Answer) -> Any:
    kind = sniff(path, filename, limits)
    if kind is Format.ZIP:
        return _in_archive(path, reading, limits, answer)
    if kind is not Format.TEXT:
        return sandbox.read_isolated(kind, path, answer, reading=reading, limits=limits, filename=filename)
    text = partial(read_text, partial(opened, path, limits), limits=limits, any_encoding=answer == "suggestion")
    return sandbox.answered(text, reading, limits, answer, filename)


def _in_archive(path: Path, reading: Reading, limits: Limits, answer: sandbox.Answer) -> Any:
    """The answer for the only record in an archive; if there are several, for the one that `reading` names, as `file`
    or `file/table`."""

    def read_by(name: str, asked: Reading) -> Any:
        with unpacked(path, name, limits) as plain:
            if sniff(plain, name, limits) is Format.ZIP:
                raise InvalidError(f"{name!r} is an archive inside the archive: unpack it and send its file")
            return _read(plain, name, asked, limits, answer)

    def read(name: str, table: str) -> Any:
        return read_by(name, replace(reading, table=table))

    names = members(path, limits)
    if reading.reads_all() and answer != "suggestion":
        return _all_of_archive(names, read_by, reading, answer)
    matching = [name for name in names if reading.table in (name, Path(name).name)]
    within = [name for name in names if reading.table.startswith(f"{name}/")]
    if len(matching) == 1:
        return read(matching[0], "")
    if within:
        return read(within[0], reading.table[len(within[0]) + 1 :])
    if not reading.table:
        with ExitStack() as stack:
            if (beside := _beside(path, names, reading, limits, stack)) is not None:
                return sandbox.answered(lambda _: beside, reading, limits, answer, "")
    records: dict[str, Any] = {}
    refused: list[InvalidError] = []
    for name in names[:_MAX_TRIED]:
        try:
            found = read(name, reading.table)
            records |= {name: found} if found else {}
        except InvalidError as error:
            refused.append(error)
    if not records and len(refused) == 1:
        raise refused[0]
    if answer == "suggestion" and len(records) != 1:
        return _for_all(list(records.values()))
    return list(records.values())[index_of_wanted(list(records) or names, "", "file")]


def _beside(path: Path, names: Sequence[str], reading: Reading, limits: Limits, stack: ExitStack) -> Table | None:
    """The table of an archive's texts that each hold other channels of one record, open as long as `stack`; None where they
    are anything else."""
    tables = []
    for name in names if 1 < len(names) <= _MAX_TRIED else ():
        plain = stack.enter_context(unpacked(path, name, limits))
        try:
            if sniff(plain, name, limits) is not Format.TEXT:
                return None
            table = read_text(partial(opened, plain, limits), reading, limits, any_encoding=True)
        except InvalidError:
            continue  # a note beside the records
        tables.append(replace(table, name=PurePath(name).stem))
    return beside_each_other(tables) if len(tables) > 1 else None


def _all_of_archive(names: Sequence[str], read: Callable[[str, Reading], Any], reading: Reading, answer: str) -> Any:
    """The channels of all files of an archive, one below the other; for a preview, that of the first file."""

    def asked(name: str) -> Reading:
        stated = {channel: _by_name(name, channel, choice) for channel, choice in reading.mapping.items()}
        return replace(reading, table="", mapping=stated)

    found: list[Any] = []
    notes: list[str] = []
    for name in names:
        try:
            found.append(read(name, asked(name)))
        except InvalidError as error:
            if not error.errors or error.errors[0].code not in _NO_PART:
                raise
            notes.append(name)
        if found and answer == "preview":
            return found[0]
    joined = below_each_other(found)
    message = f"left out, because other columns stand in it: {', '.join(notes)[:MAX_QUOTED]}"
    notice = Notice(code="parts_left_out", message=message)
    return replace(joined, notices=(*joined.notices, notice)) if notes else joined


def _by_name(name: str, channel: str, choice: ColumnChoice) -> ColumnChoice:
    """A choice with `=sheets` replaced by the value that a file's name states."""
    value = value_of_part(PurePath(name).stem, (), channel) if choice.column == SHEETS else None
    return choice if value is None else replace(choice, column=f"={value:g}", unit=CHANNELS[channel].unit)


def _for_all(proposals: Sequence[Proposal]) -> Proposal | None:
    """How all files of an archive may be read that are read alike, but for a value that the name of each states; None where
    they are not."""
    readings = [replace(proposal.reading, table=ALL) for proposal in proposals]
    if any(reading != readings[0] for reading in readings):
        readings = [replace(own, mapping=dict(map(_by_names, own.mapping.items()))) for own in readings]
    if not readings or any(reading != readings[0] for reading in readings):
        return None
    return replace(proposals[0], reading=readings[0], confidence=min(_ALL, *(own.confidence for own in proposals)))


def _by_names(choice: tuple[str, ColumnChoice]) -> tuple[str, ColumnChoice]:
    """The choice of a channel, with the values that files' names state in place of a constant."""
    return choice[0], ColumnChoice(column=SHEETS) if choice[1].is_constant() else choice[1]
