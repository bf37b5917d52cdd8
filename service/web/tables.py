"""Tables as CSV: rows as they go out, whole or a page of them."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from service.lists import Place, sliced
from service.queries.cache import Page

Rows = Iterable[Mapping[str, Any]]
#: Rows of a page, and the cursor of the next one; None on the last.
RowsAndNext = tuple[Rows, str | None]
#: How a text begins that spreadsheets take for a formula. Source: https://owasp.org/www-community/attacks/CSV_Injection.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def sliced_rows(rows: Rows, limit: int, after: Place | None) -> RowsAndNext:
    """A page of rows that are known whole."""
    page = sliced(list(rows), limit, after)
    return page["items"], page["next"]


def encode_page(columns: Sequence[str], rows: Rows, following: str | None) -> Page:
    """A page of a table as CSV."""
    return Page(encode_table(columns, rows), following)


def encode_table(columns: Sequence[str], rows: Rows) -> bytes:
    """CSV after RFC 4180 in UTF-8, a header row first; null is an empty field.

    A first row with other names than `columns` gives the columns. Text that a spreadsheet would take for a formula has an
    apostrophe before it: a note that a rig has sent must compute nothing, and send nothing, where an engineer opens it.
    """
    text = io.StringIO()
    writer: csv.DictWriter[str] | None = None
    for row in rows:
        if writer is None:
            names = columns if row.keys() == set(columns) else tuple(row)
            writer = csv.DictWriter(text, fieldnames=names, extrasaction="raise", restval="")
            writer.writeheader()
        writer.writerow({name: _cell(value) for name, value in row.items()})
    if writer is None:
        csv.writer(text).writerow(columns)
    return text.getvalue().encode()


def _cell(value: object) -> object:
    if isinstance(value, str) and value.startswith(_FORMULA):
        return f"'{value}"
    return "" if value is None else value
