"""A table for a person to look at: its first rows, and what each column is taken for, as JSON."""

from dataclasses import asdict
from typing import Any

from service.errors import MAX_QUOTED, InvalidError
from service.readers.column_names import choices_of, column_of, understood
from service.readers.constants import constants, stacked_columns, with_constants
from service.readers.long_table import widened
from service.readers.table import Reading, Table, labels

#: Lines above the table that are shown. Chosen: a screenful.
_MAX_LINES = 50


def preview(table: Table, reading: Reading) -> dict[str, Any]:
    """The table and its columns.

    `columns`: of each its `title`, the `unit` that the file states, the one `stated` by the caller's map, the `channel` that
    it is taken for (null: left out), and the unit that it is `read_in` (null: not known). `problem` says why the columns
    cannot be read so.
    """
    try:
        table, reading = widened(stacked_columns(with_constants(table, reading), reading), reading)
        constants(table, reading)
        chosen, errors = understood(table.columns, reading)
    except InvalidError as error:
        chosen, errors = [], [error]
    by_index = {column.index: column for column in chosen}
    stated_in_map = {channel: column_of(choice.column).unit for channel, choice in choices_of(reading).items()}
    columns = []
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
        "notices": [asdict(notice) for notice in table.notices],
    }
