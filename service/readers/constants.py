"""A channel that no column holds: `=5 bar`, `=LABEL` of a cell above the table, `=columns`, `=sheets`; and files in parts.

`=columns` stands for a value in the titles of columns (`M @ 3 bar`, `M @ 5 bar`; or `3`, `5` over cells that are one
quantity, `=cells`), whose rows are read one part below the other, with a column of that title for the channel. The parts of
a file are its sheets, groups or archived files, and blocks below each other: `=sheets` is a value in their names, or in the
lines above each.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.channels import CHANNELS
from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers.column_names import choices_of, column_of
from service.readers.meanings import known_channel
from service.readers.stated_clocks import in_seconds
from service.readers.table import (
    CELLS,
    COLUMNS,
    SHEETS,
    ColumnChoice,
    FileColumn,
    Reading,
    Table,
    index_of_wanted,
    is_per_column,
    labels,
)
from service.readers.unit_table import conversion, spellings

_NEEDED = {"torque_nm", "speed_rpm", "pressure_bar"}
#: Names of arrays and columns that say only that they hold values.
VALUE_NAMES = ("data", "values", "value", "y", "samples", "wert", "messwert", "valeur")
_NUMBER = re.compile(r"(?P<number>[+-]?\d+(?:[.,]\d+)?)\s*(?P<unit>\S.*)?")
#: A value with its unit within a title, and what may stand around it.
_WITHIN = re.compile(
    r"[@(\[{,;:_ ]*(?:\b(?:at|bei|p) ?=? ?|(?<![^\W_]))(?P<number>\d+(?:[.,]\d+)?) ?(?P<unit>[^\W\d_]+)(?![^\W_])[)\]}]*"
)


def constants(table: Table, reading: Reading) -> dict[str, float]:
    """The constant channels stated by the caller, in their units; empty for a file in parts.

    Raises InvalidError if a value or its unit is ambiguous.
    """
    if reading.reads_all():
        return {}
    stated = labels((table.heads or [table.above])[0])
    return {
        channel: _value(channel, choice, stated)
        for channel, choice in reading.mapping.items()
        if choice.is_constant() and channel != "time_s"
    }


def stated_step(table: Table, reading: Reading) -> float | None:
    """The step between rows [s] that the caller states in place of a column of times: `=100 Hz`, `=10 ms`, or `=LABEL` of
    one of both above the table. Raises InvalidError where it is neither."""
    choice = choices_of(reading).get("time_s")
    if choice is None or not choice.is_constant():
        return None
    text, unit = _stated_text("time_s", choice, labels((table.heads or [table.above])[0]))
    match = _NUMBER.fullmatch(text)
    unit = (unit or (match["unit"] if match else None) or "").strip("[]() ")
    number = 0.0 if match is None else float(match["number"].replace(",", "."))
    if not unit or number <= 0:
        message = f"map gives time_s {text[:MAX_QUOTED]!r}: it must be a rate or a step, such as =100 Hz or =10 ms"
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=text)
    return in_seconds(number, unit, choice.column[1:], rate=conversion("time_s", unit) is None)


def with_constants(table: Table, reading: Reading) -> Table:
    """The table with an added column for each channel that is constant in each of its blocks, for a file read in parts.

    A value is what the caller states, or stands in the lines above each block, or with `=sheets` in the table's name.
    Raises InvalidError, once it is read, where a value or its unit is not clear.
    """
    asked = {of: own for of, own in reading.mapping.items() if own.is_constant() or own.column == SHEETS}
    asked.pop("time_s", None)
    if not reading.reads_all() or not asked:
        return table
    width, others = len(table.columns), list(asked)

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        held = {index: name for index, name in taken.items() if index < width} or {0: ""}
        columns = dict(zip(held, table.read(held), strict=True))
        sizes = np.diff([0, *table.breaks, len(next(iter(columns.values())))])
        heads = table.heads or [table.above]
        for index in taken.keys() - held.keys():
            values = [
                _value_of(others[index - width], asked[others[index - width]], table.name, head) for head in heads
            ]
            columns[index] = np.repeat(values, sizes)
        return [columns[index] for index in taken]

    more = [FileColumn(own.column, CHANNELS[of].unit, title=own.column) for of, own in asked.items()]
    return replace(table, columns=(*table.columns, *more), read=read)


def _value_of(channel: str, choice: ColumnChoice, name: str, head: Sequence[Sequence[str]]) -> float:
    """The channel's value in one block, from the lines above it."""
    if choice.column != SHEETS:
        return _value(channel, replace(choice, factor=1.0, offset=0.0), labels(head))
    value = value_of_part(name, head, channel)
    if value is None:
        part = repr(name[:MAX_QUOTED])
        message = f"map gives {channel} the values in the names of the file's parts, of which one states none: {part}"
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=SHEETS)
    return value


def value_of_part(name: str, head: Sequence[Sequence[str]], channel: str) -> float | None:
    """A channel's value stated by the name of a part of a file, else by the nearest line above it."""
    for text in (name.replace("_", " "), *(" ".join(filter(None, row)) for row in reversed(head))):
        if held := value_within(text, channel):
            return held[0]
    return None


def in_parts(tables: Sequence[Table]) -> Table:
    """One table of several parts: the tables of a file that share the most frequent titles."""
    titles = [tuple(column.name for column in table.columns) for table in tables]
    usual = Counter(titles).most_common(1)[0][0]
    parts = [table for table, own in zip(tables, titles, strict=True) if own == usual]
    out = ", ".join(table.name[:MAX_QUOTED] for table in tables if table not in parts)
    if out:
        notice = Notice(code="parts_left_out", message=f"left out, because other columns stand in it: {out}")
        parts[0] = replace(parts[0], notices=[*parts[0].notices, notice])
    return replace(parts[0], parts=tuple(parts))


def refuse_several_tests(columns: Sequence[FileColumn]) -> None:
    """Raise InvalidError if several groups each hold a torque, a speed and a pressure, so that each is a test of its own."""
    held: dict[str, set[str | None]] = {}
    for column in columns:
        held.setdefault(column.group, set()).add(known_channel(column.name))
    tests = [group for group, channels in held.items() if channels >= _NEEDED]
    if len(tests) > 1:
        index_of_wanted(tests, "", "group")


def beside_each_other(tables: Sequence[Table]) -> Table | None:
    """Tables of one file that each hold other channels of one record and their times, as one table of which they are the
    groups; None where one holds a test, or they hold none together."""
    own = [[_named_by_part(column, table.name) for column in table.columns] for table in tables]
    held = [{known_channel(column.name) for column in columns} for columns in own]
    if any(part >= _NEEDED or "time_s" not in part for part in held) or not set().union(*held) >= _NEEDED:
        return None
    places = [(table, at) for table in tables for at in range(len(table.columns))]
    notices: list[Notice] = []

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        values: dict[int, NDArray[Any]] = {}
        for table in tables:
            of_table = {places[index][1]: index for index in taken if places[index][0] is table}
            if of_table:
                read_columns = table.read({at: taken[index] for at, index in of_table.items()})
                values |= dict(zip(of_table.values(), read_columns, strict=True))
        notices[:] = [notice for table in tables for notice in table.notices]
        return [values[index] for index in taken]

    return Table(columns=tuple(column for columns in own for column in columns), read=read, notices=notices)


def _named_by_part(column: FileColumn, part: str) -> FileColumn:
    """A column of a part of a file, by the part's name where its own says only that it holds values."""
    name = part if column.name.casefold() in VALUE_NAMES else column.name
    return replace(
        column, name=name, group=part, title=column.title if name == column.name else f"{part} {column.title}"
    )


def _value(channel: str, choice: ColumnChoice, stated: Mapping[str, str]) -> float:
    """A constant channel's value as stated by the caller, or beside the label that the caller names."""
    text, unit = _stated_text(channel, choice, stated)
    match = _NUMBER.fullmatch(text)
    unit = unit or (match["unit"] if match else None) or CHANNELS[channel].unit
    value = _in_channel_unit(channel, match["number"], unit.strip("[]() ")) if match else None
    if value is None:
        message = (
            f"map gives {channel} the value {text[:MAX_QUOTED]!r}: it must be a number in one of {spellings(channel)}"
        )
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=text)
    return choice.factor * value + choice.offset


def _stated_text(channel: str, choice: ColumnChoice, stated: Mapping[str, str]) -> tuple[str, str | None]:
    """The text of a stated value and its unit, by the caller or beside the label that the caller names."""
    text, unit = choice.column[1:].strip(), choice.unit
    if not _NUMBER.fullmatch(text):
        texts = {label.rstrip(":= ").casefold(): (label, cell) for label, cell in stated.items()}
        texts |= {column_of(label).name.casefold(): held for label, held in list(texts.items())}
        if text.casefold() not in texts:
            shown = ", ".join(repr(label) for label, _ in [*dict.fromkeys(texts.values())][:10]) or "none"
            message = (
                f"map gives {channel} the value beside {text[:MAX_QUOTED]!r} above the table, where there are: {shown}"
            )
            raise InvalidError.of(message, code="no_such_label", pointer="/map", value=text)
        label, text = texts[text.casefold()]
        unit = unit or column_of(label).unit
    return text, unit


def _in_channel_unit(channel: str, number: str, unit: str) -> float | None:
    """A number as it is written, in the channel's unit; None where it is in no unit of it."""
    converted = conversion(channel, unit)
    return None if converted is None else converted.factor * float(number.replace(",", ".")) + converted.offset


def value_within(text: str, channel: str) -> tuple[float, str] | None:
    """The channel's value stated in a title or a sheet's name, in the channel's unit, and the text without it; None if
    there is none, or several."""
    found = [
        (value, " ".join(f"{text[: match.start()]} {text[match.end() :]}".split()))
        for match in _WITHIN.finditer(text[:MAX_QUOTED])
        if (value := _in_channel_unit(channel, match["number"], match["unit"])) is not None
    ]
    return found[0] if len(found) == 1 else None


def stacked_columns(table: Table, reading: Reading) -> Table:
    """The table with one part for each value of a channel stated in its titles, one below the other; the table itself
    if the caller does not request it.

    Raises InvalidError if the titles state no values, or not the same columns for each.
    """
    mapping = reading.mapping
    channel = next((name for name in mapping if (own := mapping[name].column) == COLUMNS or is_per_column(own)), None)
    if channel is None:
        return table
    unit = mapping[channel].unit
    if mapping[channel].column == COLUMNS:
        stated = [value_of_column(column, channel, unit) if column.title else None for column in table.columns]
    else:
        stated = _stated_per_column(table.columns, channel, mapping[channel].column)
    values = sorted({held[0] for held in stated if held})
    shared = [at for at, held in enumerate(stated) if held is None and table.columns[at].title]
    of_each = [[at for at, held in enumerate(stated) if held and held[0] == value] for value in values]
    names = [[(stated[at] or (0, ""))[1] for at in places] for places in of_each]
    if not values or any(own != names[0] for own in names):
        message = (
            f"map gives {channel} the values in the titles of columns, which must name the same columns for each value"
        )
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=COLUMNS)
    columns = [replace(table.columns[at], clock=None, rows=None) for at in shared]
    for at, name in zip(of_each[0], names[0], strict=True):
        column = replace(table.columns[at], name=name, group="", clock=None, rows=None)
        columns.append(column if name != CELLS else FileColumn(CELLS, title=CELLS))
    unit, width = CHANNELS[channel].unit, len(columns)

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        held = {index: name for index, name in taken.items() if index < width} or {0: ""}
        places = [[*shared, *own] for own in of_each]
        wanted = {own[index]: name for own in places for index, name in held.items()}
        cells = dict(zip(wanted, table.read(wanted), strict=True))
        parts = [_without_empty_end({index: cells[own[index]] for index in held}, len(shared)) for own in places]
        sizes = [len(next(iter(part.values()))) for part in parts]
        joined = {index: _concatenated([part[index] for part in parts]) for index in held}
        return [np.repeat(values, sizes) if index == width else joined[index] for index in taken]

    head = [
        [*(row[at] for at in [*shared, *of_each[0]]), f"{values[0]:g}"] for row in table.head if len(row) == len(stated)
    ]
    listed = ", ".join(f"{value:g}" for value in values)
    message = f"{channel} is {listed} {unit} by the columns: their rows were read one below the other"
    return replace(
        table,
        columns=(*columns, FileColumn(mapping[channel].column, unit, title=mapping[channel].column)),
        read=read,
        head=tuple(map(tuple, head)),
        line_of=None,
        breaks=(),
        notices=[*table.notices, Notice(code="stacked", message=message)],
    )


def _stated_per_column(columns: Sequence[FileColumn], channel: str, choice: str) -> list[tuple[float, str] | None]:
    """A channel's value for each column by the caller's map (`=5@torque_5bar,=10@torque_10bar`), with the quantity that the
    column holds: by its title, else torque. Raises InvalidError for a value that is none or a title that no column has."""
    values: dict[str, float] = {}
    for part in re.split(r",(?==[^,@]*@)", choice):
        text, _, title = part[1:].partition("@")
        values[title.strip()] = _value(channel, ColumnChoice(column=f"={text.strip()}"), {})
    titles = [next((name for name in (column.title, column.name) if name in values), "") for column in columns]
    if lacking := [title for title in values if title not in titles]:
        message = f"map gives {channel} a value for a column {lacking[0]!r}, which the table does not have"
        raise InvalidError.of(message, code="invalid_map", pointer="/map", value=lacking[0])
    found: list[tuple[float, str] | None] = []
    for column, title in zip(columns, titles, strict=True):
        within = value_of_column(column, channel)
        quantity = within[1] if within and within[1] != CELLS else "torque_nm"
        found.append((values[title], quantity) if title in values else None)
    return found


def value_of_column(column: FileColumn, channel: str, unit: str | None = None) -> tuple[float, str] | None:
    """The channel's value stated by a column's title or group (a bare number counts in the caller's `unit`), and the
    quantity in the rest of the title; None without a value."""
    if held := value_within(column.name, channel):
        return held[0], held[1] or CELLS
    if held := value_within(column.group, channel):
        return held[0], column.name
    match = _NUMBER.fullmatch(column.name)
    if match is None or match["unit"] or unit is None:
        return None
    value = _in_channel_unit(channel, match["number"], unit)
    return None if value is None else (value, CELLS)


def _without_empty_end(part: dict[int, NDArray[Any]], shared: int) -> dict[int, NDArray[Any]]:
    """Columns [n] by index without the empty rows at their end, except for the `shared` ones: a part beside it is
    longer."""
    own = [values for index, values in part.items() if index >= shared]
    filled = [at for at, row in enumerate(zip(*own, strict=True)) if any(not _is_empty(cell) for cell in row)]
    end = filled[-1] + 1 if filled else None
    return {index: values[:end] for index, values in part.items()} if end else part


def _is_empty(cell: Any) -> bool:
    return cell is np.ma.masked or cell is None or cell == ""


def _concatenated(pieces: Sequence[NDArray[Any]]) -> NDArray[Any]:
    masked = any(isinstance(piece, np.ma.MaskedArray) for piece in pieces)
    return np.asanyarray((np.ma.concatenate if masked else np.concatenate)(pieces))
