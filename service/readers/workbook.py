"""XLSX, XLS and ODS -> a table, by python-calamine: of several sheets the one that holds channels, or the one that is named.

Runs in the reading process of `sandbox`. A workbook's numbers are numbers whatever their format; text that looks like a
number is read as CSV's.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from python_calamine import CalamineWorkbook, SheetTypeEnum, SheetVisibleEnum

from service.errors import InvalidError, Notice
from service.readers.column_names import named_columns, recognised
from service.readers.constants import beside_each_other, in_parts
from service.readers.detect import check_archive
from service.readers.limits import Limits
from service.readers.table import Reading, Table, index_of_wanted
from service.readers.table_finder import MAX_ROWS, TURNED, DataRows, Layout, find_table, no_table, table_in, turned
from service.readers.workbook_cells import SheetCells, sheet_cells


def read_table(path: Path, reading: Reading, limits: Limits) -> Table:
    """The table of the one sheet with channels, or of the named one."""
    with path.open("rb") as file:
        packed = file.read(2) == b"PK"
    if packed:
        check_archive(path, limits)
    book = CalamineWorkbook.from_path(str(path))
    sheets = [sheet.name for sheet in book.sheets_metadata if sheet.typ == SheetTypeEnum.WorkSheet]
    named = named_columns(reading)
    if (reading.table and not reading.reads_all()) or len(sheets) == 1:
        sheet, _, number = reading.table.rpartition("/")  # of tables below each other on a sheet
        wanted = sheet if sheet in sheets and number.isdecimal() else reading.table
        sheets = sheets if reading.reads_all() else [sheets[index_of_wanted(sheets, wanted, "sheet")]]
    tables: dict[str, tuple[list[Sequence[Any]], Layout]] = {}
    refused: list[InvalidError] = []
    on_side: set[str] = set()
    hidden: dict[str, set[int]] = {}
    for name in sheets:
        rows, hidden[name] = _rows(book, name, path if packed else None)
        rows[: reading.skip_rows] = [()] * len(rows[: reading.skip_rows])
        layout = find_table(rows[: reading.skip_rows + MAX_ROWS], frozenset(), named)
        if layout is None and len(rows) <= MAX_ROWS and (on_its_side := turned(rows, named)):
            rows, layout = on_its_side
            on_side.add(name)
            hidden[name] = set()  # its channels
        if layout is None:
            refused.append(no_table(rows[: reading.skip_rows + MAX_ROWS], named))
        elif len(sheets) == 1 or recognised([heading[0] for heading in layout.headings], named):
            tables[name] = rows, layout
    if not tables and refused:
        raise refused[0]
    visible = {sheet.name for sheet in book.sheets_metadata if sheet.visible == SheetVisibleEnum.Visible}
    tables = {name: cells for name, cells in tables.items() if name in visible} or tables
    if reading.reads_all() and tables:
        return in_parts([_table(name, *tables[name], hidden[name], tuple(sheets), limits) for name in tables])
    if len(tables) > 1:
        of_all = [_table(name, *tables[name], hidden[name], tuple(sheets), limits) for name in tables]
        if (beside := beside_each_other(of_all)) is not None:
            return beside
    name = list(tables)[index_of_wanted(list(tables) or sheets, "", "sheet")]
    table = _table(name, *tables[name], hidden[name], tuple(sheets), limits)
    return replace(table, notices=[*table.notices, TURNED]) if name in on_side else table


def _rows(book: CalamineWorkbook, sheet: str, path: Path | None) -> tuple[list[Sequence[Any]], set[int]]:
    """The rows of a sheet and which are hidden; with the names of error values, and formulas that have no value, in their
    cells. `path`: of a file whose cells can be looked at."""
    rows = book.get_sheet_by_name(sheet).to_python(skip_empty_area=False)
    said = SheetCells() if path is None else sheet_cells(path, sheet)
    for (row, column), text in said.texts.items():
        rows += [[] for _ in range(row + 1 - len(rows))]
        rows[row] += [""] * (column + 1 - len(rows[row]))
        rows[row][column] = text
    return [_trimmed(row) for row in rows], said.hidden


def _trimmed(row: Sequence[Any]) -> Sequence[Any]:
    """A row without the empty cells at its end, which only other rows of the sheet need."""
    end = len(row)
    while end and row[end - 1] in ("", None):
        end -= 1
    return row[:end]


def _table(
    name: str,
    rows: list[Sequence[Any]],
    layout: Layout,
    hidden: Collection[int],
    sheets: tuple[str, ...],
    limits: Limits,
) -> Table:
    limits.require_columns(len(layout.headings))
    data = DataRows(rows, layout)
    shown = ((at + 1, rows[at], False) for at in range(layout.start, len(rows)) if at not in hidden)
    lines, cells = data.of(shown, 0, last=True)
    data.end()
    out = [at + 1 for at in sorted(hidden) if layout.start <= at < len(rows)]
    if out:
        listed = ", ".join(map(str, out[:10])) + (" ..." if len(out) > 10 else "")
        hidden_rows = f"{len(out)} hidden row{'s' * (len(out) > 1)} of the sheet"
        message = f"left out: {hidden_rows}: {listed}. To have them read, unhide them"
        data.notices.append(Notice(code="lines_left_out", message=message))

    def read(channels: Mapping[int, str]) -> list[NDArray[Any]]:
        columns = []
        for index in channels:
            columns.append(np.empty(len(cells), dtype=object))
            columns[-1][:] = [row[index] if index < len(row) else "" for row in cells]
        return columns

    others = {"line_of": lines.__getitem__, "name": name, "others": sheets}
    return table_in(data, first_line=layout.start + 1, rows_read=lambda: len(cells), read=read, **others)
