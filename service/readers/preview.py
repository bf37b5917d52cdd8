"""A table for a person to look at: its first rows, and what each column is taken for, as JSON."""

from typing import TypedDict

from service.errors import MAX_QUOTED, InvalidError
from service.readers.column_names import choices_of, column_of, understood
from service.readers.constants import constants
from service.readers.long_table import in_columns
from service.readers.table import Reading, Table, labels

#: Lines above the table that are shown. Chosen: a screenful.
_MAX_LINES = 50


class ShownColumn(TypedDict):
    """A column of a preview: its title, the units stated by the file and by the caller's map, its channel (None: left
    out), and the unit it is read in (None: unknown)."""

    title: str
    name: str
    group: str
    unit: str | None
    stated: str | None
    channel: str | None
    read_in: str | None


class ShownTable(TypedDict):
    """A table of a preview: its name and those of other tables, the cells above it and their labels, its first rows,
    and its columns. `problem` says why the columns cannot be read."""

    table: str
    tables: list[str]
    above: list[list[str]]
    labels: dict[str, str]
    first_line: int | None
    head: list[list[str]]
    columns: list[ShownColumn]
    problem: str | None


def preview(table: Table, reading: Reading) -> ShownTable:
    """The preview of a table and its columns, even if they cannot be read."""
    try:
        table, reading = in_columns(table, reading)
        constants(table, reading)
        chosen, errors = understood(table.columns, reading)
    except InvalidError as error:
        chosen, errors = [], [error]
    by_index = {column.index: column for column in chosen}
    stated_in_map = {channel: column_of(choice.column).unit for channel, choice in choices_of(reading).items()}
    columns: list[ShownColumn] = []
    for index, column in enumerate(table.columns):
        chosen_here = by_index.get(index)
        columns.append(
            {
                "title": column.title or column.name,
                "name": column.name,
                "group": column.group,
                "unit": column.unit,
                "stated": None if chosen_here is None else stated_in_map.get(chosen_here.channel),
                "channel": None if chosen_here is None else chosen_here.channel,
                "read_in": None if chosen_here is None else chosen_here.unit,
            }
        )
    return {
        "table": table.name,
        "tables": list(table.others),
        "above": [[cell[:MAX_QUOTED] for cell in row] for row in table.above[-_MAX_LINES:]],
        "labels": labels(table.above),
        "first_line": table.first_line,
        "head": [[cell[:MAX_QUOTED] for cell in row] for row in table.head],
        "columns": columns,
        "problem": errors[0].detail if errors else None,
    }
