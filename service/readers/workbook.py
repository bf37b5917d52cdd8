"""XLSX, XLS and ODS -> a table, by python-calamine: of several sheets the one that holds channels, or the one that is named.

Runs in the reading process of `sandbox`. A workbook's numbers are numbers whatever their format; text that looks like a
number is read as CSV's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from python_calamine import CalamineWorkbook, SheetTypeEnum, SheetVisibleEnum

from service.errors import InvalidError
from service.readers.clocks import stated_clock
from service.readers.column_names import choices_of, recognised
from service.readers.detect import check_archive
from service.readers.grid import (
    MAX_ROWS,
    Layout,
    find_table,
    is_blank,
    is_footer,
    is_value,
    left_out,
    no_table,
    refuse_factors,
    turned,
    was_turned,
)
from service.readers.limits import Limits
from service.readers.table import Reading, Table, labels, only

#: Rows of data that a person is shown.
_MAX_SHOWN = 20


def read_table(path: Path, reading: Reading, limits: Limits) -> Table:
    """The table of the one sheet with channels, or of the named one."""
    with path.open("rb") as file:
        packed = file.read(2) == b"PK"
    if packed:
        check_archive(path, limits)
    book = CalamineWorkbook.from_path(str(path))
    sheets = [sheet.name for sheet in book.sheets_metadata if sheet.typ == SheetTypeEnum.WorkSheet]
    named = [choice.column for choice in choices_of(reading).values()]
    if reading.table or len(sheets) == 1:
        sheet, _, number = reading.table.rpartition("/")  # of tables below each other on a sheet
        sheets = [sheets[only(sheets, sheet if sheet in sheets and number.isdecimal() else reading.table, "sheet")]]
    tables: dict[str, tuple[list[Sequence[Any]], Layout]] = {}
    refused: list[InvalidError] = []
    on_side: set[str] = set()
    for name in sheets:
        rows: list[Sequence[Any]] = [
            _trimmed(row) for row in book.get_sheet_by_name(name).to_python(skip_empty_area=False)
        ]
        layout = find_table(rows[reading.skip_rows : reading.skip_rows + MAX_ROWS], frozenset(), named)
        if layout is None and len(rows) <= MAX_ROWS and (on_its_side := turned(rows, named)):
            (rows, layout), on_side = on_its_side, {*on_side, name}
        if layout is None:
            refused.append(no_table(rows[: reading.skip_rows + MAX_ROWS], named))
        elif len(sheets) == 1 or recognised([heading[0] for heading in layout.headings], named):
            tables[name] = rows, layout
    if not tables and refused:
        raise refused[0]
    visible = {sheet.name for sheet in book.sheets_metadata if sheet.visible == SheetVisibleEnum.Visible}
    tables = {name: held for name, held in tables.items() if name in visible} or tables
    name = list(tables)[only(list(tables) or sheets, "", "sheet")]
    table = _table(name, *tables[name], reading, tuple(sheets), limits)
    return replace(table, notices=[*table.notices, was_turned()]) if name in on_side else table


def _trimmed(row: Sequence[Any]) -> Sequence[Any]:
    """A row without the empty cells at its end, which other rows of the sheet make."""
    end = len(row)
    while end and row[end - 1] in ("", None):
        end -= 1
    return row[:end]


def _shown(cell: Any) -> str:
    return str(int(cell)) if isinstance(cell, float) and cell.is_integer() else str(cell)


def _table(
    name: str, rows: list[Sequence[Any]], layout: Layout, reading: Reading, sheets: tuple[str, ...], limits: Limits
) -> Table:
    start, titles = layout.start + reading.skip_rows, layout.titles + reading.skip_rows
    if len(layout.headings) > limits.most_columns:
        raise InvalidError(f"a sheet must not have more than {limits.most_columns} columns, got {len(layout.headings)}")
    above = {tuple(map(str, row)) for row in rows[:start] if not any(map(is_value, row))}
    lines: list[int] = []
    breaks: list[int] = []
    for index in range(start, len(rows) + 1):
        row = rows[index] if index < len(rows) else rows[titles]  # below the last table as above a further one
        if row == rows[titles]:
            while lines and is_footer(rows[lines[-1]], rows[start]):
                lines.pop()
            breaks.append(len(lines))
        elif not is_blank(row) and tuple(map(str, row)) not in above:
            lines.append(index)
    footer = [
        shown for row in rows[lines[-1] + 1 if lines else start :] if (shown := " ".join(map(_shown, row)).strip())
    ]
    notices = [left_out(len(footer), "below", footer[0])] if footer else []

    if layout.labelled:
        shown = " ".join(map(_shown, rows[start - layout.labelled]))
        notices.append(left_out(layout.labelled, "above the first row of", shown))

    def read(channels: Mapping[int, str]) -> list[NDArray[Any]]:
        columns = []
        for index in channels:
            columns.append(np.empty(len(lines), dtype=object))
            columns[-1][:] = [rows[line][index] if index < len(rows[line]) else "" for line in lines]
        return columns

    def line_of(row: int) -> int:
        return lines[row] + 1

    refuse_factors([[*map(_shown, row)] for row in rows[max(start - MAX_ROWS, 0) : start]])
    shown_above = tuple(tuple(map(_shown, row)) for row in rows[max(titles - MAX_ROWS, 0) : titles])
    clock = stated_clock(labels(shown_above), lambda: len(lines))
    return Table(
        columns=tuple(replace(column, clock=clock) for column in layout.columns()),
        read=read,
        name=name,
        others=sheets,
        above=shown_above,
        first_line=start + 1,
        head=tuple(tuple(map(_shown, rows[line])) for line in lines[:_MAX_SHOWN]),
        line_of=line_of,
        breaks=breaks[:-1],
        notices=notices,
    )
