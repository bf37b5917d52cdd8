"""A table for a person to look at: its first rows, and what each column is taken for, as JSON."""

from typing import Any

from service.columns import CHANNELS
from service.errors import MAX_QUOTED, InvalidError
from service.readers.column_names import choices_of, choose, column_of, known_channel
from service.readers.long_table import widened
from service.readers.table import Reading, Table, labels
from service.readers.unit_table import conversion

#: Lines above the table that are shown. Chosen: a screenful.
_MAX_LINES = 50


def preview(table: Table, reading: Reading) -> dict[str, Any]:
    """The table and its columns.

    `columns`: of each its `title`, the `unit` that the file states, the one `stated` by the
    caller's map, the `channel` that it would be (null: left out) and the
    `factor` and `offset` to the channel's unit (null: the unit is not known). `problem` says why it cannot be read as it is.
    """
    try:
        table, reading = widened(table, reading)
        chosen = choose(table.columns, reading)
        taken = {column.index: column for column in chosen if not column.guessed or _differ(table, column.index)}
        problem = None
    except InvalidError as error:
        taken, problem = {}, error.detail
    named = {choice.column: channel for channel, choice in choices_of(reading).items()}
    stated_in_map = {channel: column_of(choice.column).unit for channel, choice in choices_of(reading).items()}
    columns = []
    for index, column in enumerate(table.columns):
        channel = taken[index].channel if index in taken else named.get(column.title) or known_channel(column.name)
        understood = taken[index].conversion if index in taken else None
        if understood is None and channel is not None and column.unit:
            understood = conversion(channel, column.unit)
        columns.append(
            {
                "title": column.title or column.name,
                "name": column.name,
                "group": column.group,
                "unit": column.unit,
                "stated": None if channel is None else stated_in_map.get(channel),
                "channel": channel,
                "channel_unit": None if channel is None else CHANNELS[channel].unit,
                "factor": None if understood is None else understood.factor,
                "offset": None if understood is None else understood.offset,
                "has_clock": column.clock is not None,
                "rows": column.rows,
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
        "problem": problem,
        "notices": [{"code": notice.code, "message": notice.message} for notice in table.notices],
    }


def _differ(table: Table, index: int) -> bool:
    """Whether the first cells of a column differ, as times do."""
    cells = [row[index] for row in table.head if index < len(row)]
    return len(set(cells)) == len(cells)
