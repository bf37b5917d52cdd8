"""XLSX, XLS and ODS -> a table, by python-calamine: of several sheets the one that holds channels, or the one that is named.

Runs in the reading process of `sandbox`. A workbook's numbers are numbers whatever their format; text that looks like a
number is read as CSV's.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from python_calamine import CalamineWorkbook, SheetTypeEnum

from service.errors import InvalidError
from service.readers.archive import check_archive
from service.readers.column_names import choices_of, recognised
from service.readers.grid import MOST_ROWS, Layout, find_table, is_blank, is_value, no_table
from service.readers.limits import Limits
from service.readers.numerals import column_values
from service.readers.table import Reading, Table, only

#: Rows of data that a person is shown.
_MOST_SHOWN = 20


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
        sheets = [sheets[only(sheets, reading.table, "sheet")]]
    tables: dict[str, tuple[list[Sequence[Any]], Layout]] = {}
    refused: list[InvalidError] = []
    for name in sheets:
        rows: list[Sequence[Any]] = [
            _trimmed(row) for row in book.get_sheet_by_name(name).to_python(skip_empty_area=False)
        ]
        layout = find_table(rows[reading.skip_rows : reading.skip_rows + MOST_ROWS], frozenset(), named)
        if layout is None:
            line = next((index for index, row in enumerate(rows) if not is_blank(row)), 0)
            refused.append(no_table(line + 1, " ".join(map(str, rows[line] if rows else ()))))
        elif len(sheets) == 1 or recognised([heading[0] for heading in layout.headings], named):
            tables[name] = rows, layout
    if not tables and refused:
        raise refused[0]
    name = list(tables)[only(list(tables) or sheets, "", "sheet")]
    return _table(name, *tables[name], reading, tuple(sheets), limits)


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
    headings = {tuple(map(str, row)) for row in rows[:start]}
    lines = [
        index
        for index in range(start, len(rows))
        if not is_blank(rows[index])
        and (any(map(is_value, rows[index])) or tuple(map(str, rows[index])) not in headings)
    ]

    def read(channels: Mapping[int, str]) -> list[NDArray[Any]]:
        cells = [[rows[line][index] if index < len(rows[line]) else "" for line in lines] for index in channels]
        return column_values(list(channels.values()), cells, reading.decimal, line_of)

    def line_of(row: int) -> int:
        return lines[row] + 1

    return Table(
        columns=layout.columns(),
        read=read,
        name=name,
        others=sheets,
        above=tuple(tuple(map(_shown, row)) for row in rows[max(titles - MOST_ROWS, 0) : titles]),
        first_line=start + 1,
        head=tuple(tuple(map(_shown, rows[line])) for line in lines[:_MOST_SHOWN]),
        line_of=line_of,
    )
