"""What a workbook says beside its values: hidden rows, error values and formulas that no program has computed."""

import zipfile
from pathlib import Path

import openpyxl  # type: ignore[import-untyped]
import pytest
import xlsxwriter  # type: ignore[import-untyped]

from service.errors import InvalidError
from service.readers.read_file import read_file, reading_of

TITLES = ["p [bar]", "n [1/min]", "M [Nm]"]
ROWS = [[4, 20, 17.4], [4, 120, 16.9], [4, 520, 99.0], [4, 1970, 16.2], [5, 20, 21.4], [5, 120, 20.9]]


def book(path: Path, rows: list[list[object]], hidden: list[int] = [], above: int = 0) -> Path:  # noqa: B006 (not changed)
    """A workbook by openpyxl, which computes nothing; rows count from 1."""
    written = openpyxl.Workbook()
    sheet = written.active
    for _ in range(above):
        sheet.append(["Prüfer", "Meier"])
    for row in [TITLES, *rows]:
        sheet.append(row)
    for row in hidden:
        sheet.row_dimensions[row].hidden = True
    written.save(path)
    return path


def read(path: Path, **options: str) -> tuple[list[float], list[str]]:
    channels = read_file(path, filename=path.name, reading=reading_of(None, **options))
    return channels.columns["torque_nm"].tolist(), [notice.message for notice in channels.notices]


@pytest.mark.parametrize("above", [0, 2])
def test_hidden_rows_are_left_out_and_said_so(tmp_path: Path, above: int) -> None:
    path = book(tmp_path / "a.xlsx", ROWS, hidden=[above + 4], above=above)
    assert read(path) == (
        [17.4, 16.9, 16.2, 21.4, 20.9],
        [f"left out: 1 hidden row of the sheet: {above + 4}. To have them read, unhide them"],
    )


def test_hidden_titles_are_read_and_a_filter_of_another_sheet_is_not_that_of_this(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    with xlsxwriter.Workbook(path) as written:
        for name in ("Notes", "Test & 1"):
            sheet = written.add_worksheet(name)
            for at, row in enumerate([TITLES, *ROWS] if name != "Notes" else [["a"]] * 9):
                sheet.write_row(at, 0, row)
            for at in range(2, 5) if name == "Notes" else [0]:
                sheet.set_row(at, options={"hidden": True})
    assert read(path) == ([row[2] for row in ROWS], [])


@pytest.mark.parametrize("visibility", ["filter", "collapse"])
def test_hidden_rows_of_ods_are_left_out(tmp_path: Path, visibility: str) -> None:
    texts = [TITLES, *ROWS]
    cells = [
        "".join(
            f'<table:table-cell office:value-type="float" office:value="{cell}"/>'
            if not isinstance(cell, str)
            else f'<table:table-cell office:value-type="string"><text:p>{cell}</text:p></table:table-cell>'
            for cell in row
        )
        for row in texts
    ]
    attribute = f' table:visibility="{visibility}"'
    rows = [f"<table:table-row{attribute * (at == 3)}>{row}</table:table-row>" for at, row in enumerate(cells)]
    names = " ".join(
        f'xmlns:{name}="urn:oasis:names:tc:opendocument:xmlns:{name}:1.0"' for name in ("office", "table", "text")
    )
    content = (
        f'<?xml version="1.0"?><office:document-content {names}><office:body><office:spreadsheet>'
        f'<table:table table:name="A">{"".join(rows)}</table:table></office:spreadsheet></office:body>'
        "</office:document-content>"
    )
    path = tmp_path / "a.ods"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("content.xml", content)
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
    torques, said = read(path)
    assert torques == [17.4, 16.9, 16.2, 21.4, 20.9]
    assert said == ["left out: 1 hidden row of the sheet: 4. To have them read, unhide them"]


@pytest.mark.parametrize("formula", ["=B{row}/100", '=IF(B{row}>0,"a",1)'])
def test_a_formula_that_no_program_has_computed_is_named_with_the_way_out(tmp_path: Path, formula: str) -> None:
    rows = [[p, n, formula.format(row=at)] for at, (p, n, _) in enumerate(ROWS, 2)]
    with pytest.raises(InvalidError, match=r"got '=.*no program has computed this formula. Open the workbook in Excel"):
        read(book(tmp_path / "a.xlsx", rows))


def test_a_table_of_formulas_alone_is_named_so(tmp_path: Path) -> None:
    with pytest.raises(InvalidError, match="no program has computed this formula"):
        read(book(tmp_path / "a.xlsx", [[f"=D{at}", f"=E{at}", f"=F{at}"] for at in range(2, 8)]))


def test_a_formula_with_its_value_is_that_value(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    with xlsxwriter.Workbook(path) as written:
        sheet = written.add_worksheet()
        sheet.write_row(0, 0, TITLES)
        for at, (p, n, m) in enumerate(ROWS, 1):
            sheet.write_row(at, 0, [p, n])
            sheet.write_formula(at, 2, f"=D{at}", value=m)
    assert read(path) == ([row[2] for row in ROWS], [])


@pytest.mark.parametrize("error", ["#DIV/0!", "#N/A", "#REF!", "#VALUE!", "#NAME?"])
def test_an_error_value_is_named_with_the_option_that_leaves_its_row_out(tmp_path: Path, error: str) -> None:
    rows: list[list[object]] = [[*row] for row in ROWS]
    rows[2][2] = error
    path = book(tmp_path / "a.xlsx", rows)
    with pytest.raises(InvalidError) as caught:
        read(path)
    assert f"torque_nm[2] (line 4) must be a number, got '{error}': add missing={error} to leave" in caught.value.detail
    assert read(path, missing=error)[0] == [17.4, 16.9, 16.2, 21.4, 20.9]
