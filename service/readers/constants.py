"""A channel that no column holds: `=5 bar`, `=LABEL` of a cell above the table, `=columns`, `=sheets`.

The last two stand for a value in the titles of columns (`M @ 3 bar`, `M @ 5 bar`) or in the names of sheets, whose rows are
read one part below the other, with a column of that title for the channel.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.channels import CHANNELS
from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers.column_names import column_of
from service.readers.table import COLUMNS, ColumnChoice, FileColumn, Reading, Table, labels
from service.readers.unit_table import conversion, spellings

_NUMBER = re.compile(r"(?P<number>[+-]?\d+(?:[.,]\d+)?)\s*(?P<unit>\S.*)?")
#: A value with its unit within a title, and what may stand around it.
_WITHIN = re.compile(
    r"[@(\[{,;:_ ]*(?:\b(?:at|bei|p) ?=? ?)?(?<![^\W_])(?P<number>\d+(?:[.,]\d+)?) ?(?P<unit>[^\W\d_]+)(?![^\W_])[)\]}]*"
)
#: Reads columns by their index and what each is for, once for each part.
_ReadParts = Callable[[Mapping[int, str]], Sequence[Sequence[NDArray[Any]]]]


def constants(table: Table, reading: Reading) -> dict[str, float]:
    """The channels that are constant by the caller's word, in their units. Raises InvalidError where a value or its unit is
    not clear."""
    return {
        channel: _value(channel, choice, table) for channel, choice in reading.mapping.items() if choice.is_constant()
    }


def _value(channel: str, choice: ColumnChoice, table: Table) -> float:
    text, unit = choice.column[1:].strip(), choice.unit
    if not _NUMBER.fullmatch(text):
        texts = {label.rstrip(":= ").casefold(): (label, cell) for label, cell in labels(table.above).items()}
        texts |= {column_of(label).name.casefold(): held for label, held in list(texts.items())}
        if text.casefold() not in texts:
            shown = ", ".join(repr(label) for label, _ in [*dict.fromkeys(texts.values())][:10]) or "none"
            message = (
                f"map gives {channel} the value beside {text[:MAX_QUOTED]!r} above the table, where there are: {shown}"
            )
            raise InvalidError.of(message, code="no_such_label", pointer="/map", value=text)
        label, text = texts[text.casefold()]
        unit = unit or column_of(label).unit
    match = _NUMBER.fullmatch(text)
    unit = unit or (match["unit"] if match else None) or CHANNELS[channel].unit
    converted = conversion(channel, unit.strip("[]() "))
    if match is None or converted is None:
        message = (
            f"map gives {channel} the value {text[:MAX_QUOTED]!r}: it must be a number in one of {spellings(channel)}"
        )
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=text)
    value = np.array([float(match["number"].replace(",", "."))])
    converted.apply(value)
    return choice.factor * float(value[0]) + choice.offset


def value_within(text: str, channel: str) -> tuple[float, str] | None:
    """A value of a channel that a title or a sheet's name states, in the channel's unit, and the text without it; None where
    it states none, or several."""
    found = []
    for match in _WITHIN.finditer(text[:MAX_QUOTED]):
        if converted := conversion(channel, match["unit"]):
            value = np.array([float(match["number"].replace(",", "."))])
            converted.apply(value)
            found.append((float(value[0]), " ".join(f"{text[: match.start()]} {text[match.end() :]}".split())))
    return found[0] if len(found) == 1 else None


def stacked_columns(table: Table, reading: Reading) -> Table:
    """The table with a part for each value that its titles state of a channel, one below the other; the table itself
    where the caller does not ask for it.

    Raises InvalidError where the titles state no values, or not the same columns for each.
    """
    channel = next((name for name, choice in reading.mapping.items() if choice.column == COLUMNS), None)
    if channel is None:
        return table
    stated = [value_within(column.name, channel) for column in table.columns]
    values = sorted({held[0] for held in stated if held})
    shared = [at for at, held in enumerate(stated) if held is None]
    of_each = [[at for at, held in enumerate(stated) if held and held[0] == value] for value in values]
    names = [[(stated[at] or (0, ""))[1] for at in places] for places in of_each]
    if not values or any(own != names[0] for own in names):
        message = (
            f"map gives {channel} the values in the titles of columns, which must name the same columns for each value"
        )
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=COLUMNS)
    columns = [table.columns[at] for at in shared]
    columns += [replace(table.columns[at], name=name) for at, name in zip(of_each[0], names[0], strict=True)]

    def read(taken: Mapping[int, str]) -> list[list[NDArray[Any]]]:
        places = [[*shared, *own] for own in of_each]
        wanted = {own[index]: channel for own in places for index, channel in taken.items()}
        held = dict(zip(wanted, table.read(wanted), strict=True))
        return [[held[own[index]] for index in taken] for own in places]

    head = [
        [*(row[at] for at in [*shared, *of_each[0]]), f"{values[0]:g}"] for row in table.head if len(row) == len(stated)
    ]
    first = replace(table, columns=tuple(columns), head=tuple(map(tuple, head)))
    return one_below_the_other(first, channel, values, read, COLUMNS)


def one_below_the_other(
    first: Table, channel: str, values: Sequence[float], read_parts: _ReadParts, title: str
) -> Table:
    """The parts of one table, of which `first` is the first, as one, with a column of `title` for their `values`."""
    width, sizes = len(first.columns), list[int]()
    unit = CHANNELS[channel].unit

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        held = {index: name for index, name in taken.items() if index < width} or {0: ""}
        parts = read_parts(held)
        sizes[:] = [len(part[0]) for part in parts]
        joined = {}
        for place, index in enumerate(held):
            pieces = [part[place] for part in parts]
            masked = any(isinstance(piece, np.ma.MaskedArray) for piece in pieces)
            joined[index] = (np.ma.concatenate if masked else np.concatenate)(pieces)
        return [np.repeat(values, sizes) if index == width else joined[index] for index in taken]

    listed = ", ".join(f"{value:g}" for value in values)
    message = f"{channel} is {listed} {unit} by the {title[1:]}: their rows were read one below the other"
    return replace(
        first,
        columns=(
            *(replace(column, clock=None, rows=None) for column in first.columns),
            FileColumn(title, unit, title=title),
        ),
        read=read,
        line_of=None,
        breaks=(),
        notices=[*first.notices, Notice(code="stacked", message=message)],
    )
