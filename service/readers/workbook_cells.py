"""What a workbook says beside its values, which python-calamine leaves out: hidden rows, errors, formulas without values.

XLSX and ODS alone: the cells of XLS are not looked at.
Sources: ECMA-376 part 1, 18.3.1.4 and 18.3.1.73 (`c`, `row`); OpenDocument 1.3 part 3, 19.749 (`table:visibility`).
"""

import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from posixpath import join, normpath
from typing import IO
from xml.parsers import expat

_BLOCK = 1 << 20
#: What a sheet holds of which any of it has to be looked for.
_WORTH_READING = re.compile(rb"hidden=|t=[\"']e[\"']|<(?:\w+:)?f[ >/]|visibility=")


@dataclass(slots=True)
class SheetCells:
    """Facts about one sheet's cells, rows and columns from 0: the `hidden` rows, and `texts` for cells without a value:
    an error's name, or `=` and a formula not yet computed."""

    hidden: set[int] = field(default_factory=set)
    texts: dict[tuple[int, int], str] = field(default_factory=dict)


def sheet_cells(path: Path, sheet: str) -> SheetCells:
    """The hidden rows and the error and formula texts of a sheet in an XLSX or ODS file."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        if "content.xml" in names:
            return _ods(archive, sheet)
        part = _part_of(archive, sheet) if "xl/workbook.xml" in names else ""
        return _xlsx(archive, part) if part in names else SheetCells()


class _Elements:
    """The elements of an XML file as they begin and end, without their namespaces, with the text in them."""

    def __init__(self) -> None:
        self.parser = expat.ParserCreate(namespace_separator="}")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = lambda name, held: self.begin(name.rpartition("}")[2], _plain(held))
        self.parser.EndElementHandler = lambda name: self.end(name.rpartition("}")[2])
        self.parser.CharacterDataHandler = self.text

    def begin(self, name: str, held: dict[str, str]) -> None:
        raise NotImplementedError

    def end(self, name: str) -> None:
        """An element ends."""

    def text(self, data: str) -> None:
        """Text within one."""


def _plain(held: dict[str, str]) -> dict[str, str]:
    return {name.rpartition("}")[2]: value for name, value in held.items()}


def _part_of(archive: zipfile.ZipFile, sheet: str) -> str:
    """The part of an XLSX file that holds a sheet."""
    found: dict[str, str] = {}

    class PartNames(_Elements):
        def begin(self, name: str, held: dict[str, str]) -> None:
            if name == "sheet":
                found[held.get("name", "")] = held.get("id", "")
            elif name == "Relationship":
                found["id " + held.get("Id", "")] = held.get("Target", "")

    for part in ("xl/workbook.xml", "xl/_rels/workbook.xml.rels"):
        with archive.open(part) as file:
            PartNames().parser.ParseFile(file)
    target = found.get("id " + found.get(sheet, ""), "")
    return target.lstrip("/") if target.startswith("/") else normpath(join("xl", target))


@contextmanager
def _worth_reading(archive: zipfile.ZipFile, part: str) -> Iterator[IO[bytes] | None]:
    """A part of an archive from its beginning; None if a cheap search finds nothing relevant in it."""
    with archive.open(part) as file:
        last, worth = b"", False
        while not worth and (block := file.read(_BLOCK)):
            worth, last = _WORTH_READING.search(last + block) is not None, block[-20:]
    if not worth:
        yield None
        return
    with archive.open(part) as file:
        yield file


def _xlsx(archive: zipfile.ZipFile, part: str) -> SheetCells:
    said = SheetCells()

    class SheetXml(_Elements):
        row, column, kind = -1, -1, ""
        inside = ""
        value, formula = "", ""

        def begin(self, name: str, held: dict[str, str]) -> None:
            self.inside = name
            if name == "row":
                self.row, self.column = int(held.get("r") or self.row + 2) - 1, -1
                if held.get("hidden") in ("1", "true"):
                    said.hidden.add(self.row)
            elif name == "c":
                place = held.get("r", "")
                self.column = _column(place) if place else self.column + 1
                self.kind, self.value, self.formula = held.get("t", ""), "", ""
            elif name == "f":
                self.formula = "="

        def text(self, data: str) -> None:
            if self.inside == "v":
                self.value += data
            elif self.inside == "f":
                self.formula += data

        def end(self, name: str) -> None:
            self.inside = ""
            if name == "c" and (self.kind == "e" or (self.formula and not self.value)):
                said.texts[self.row, self.column] = self.value or self.formula

    with _worth_reading(archive, part) as file:
        if file is not None:
            SheetXml().parser.ParseFile(file)
    return said


def _column(place: str) -> int:
    """The column number in a cell's name, from 0: 27 for `AB3`."""
    number = 0
    for letter in place.rstrip("0123456789"):
        number = 26 * number + ord(letter) - ord("A") + 1
    return number - 1


def _ods(archive: zipfile.ZipFile, sheet: str) -> SheetCells:
    said = SheetCells()

    class TableRows(_Elements):
        row, inside = 0, False

        def begin(self, name: str, held: dict[str, str]) -> None:
            if name == "table":
                self.row, self.inside = 0, held.get("name") == sheet
            elif name == "table-row" and self.inside:
                repeated = int(held.get("number-rows-repeated", "1"))
                if held.get("visibility", "visible") != "visible":
                    said.hidden.update(range(self.row, self.row + min(repeated, 1 << 20)))
                self.row += repeated

    with _worth_reading(archive, "content.xml") as file:
        if file is not None:
            TableRows().parser.ParseFile(file)
    return said
