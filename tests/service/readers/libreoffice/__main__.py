"""Writes the files of this folder with `soffice`, which must be installed: workbooks by openpyxl, converted."""

import subprocess
import tempfile
from pathlib import Path

import openpyxl  # type: ignore[import-untyped]

from tests.service.readers.test_corpus import RECORD

#: The language of each file's number formats, and how it groups thousands.
LANGUAGES = {"german": ("[$-407]", "#,##0.0"), "american": ("[$-409]", "#,##0.0"), "indian": ("[$-4009]", "#,##,##0.0")}
#: Cells apart by semicolons, UTF-8, numbers as they are shown.
CSV = "csv:Text - txt - csv (StarCalc):59,34,76,1,,0,false,true"


def write_workbook(path: Path, language: str, grouped: str) -> None:
    """The record with pressure in Pa and speed in rpm grouped, a line and a blank one above it, units below its titles."""
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "Messung"
    for row in (["Prüfstand 3"], [], ["Zeit", "Druck", "Drehzahl", "Drehmoment"], ["s", "Pa", "1/min", "Nm"]):
        sheet.append(row)
    for time, pressure, speed, torque in zip(*RECORD.values(), strict=True):
        sheet.append([float(time), float(round(pressure * 1e5)), float(speed), float(torque)])
        for column, shown in zip("ABCD", ("0.00", grouped, f"{grouped}0", "0.0000"), strict=True):
            sheet[f"{column}{sheet.max_row}"].number_format = language + shown
    book.save(path)


def main() -> None:
    """Write them all."""
    here = Path(__file__).parent
    with tempfile.TemporaryDirectory() as folder:
        for name, formats in LANGUAGES.items():
            workbook = Path(folder) / f"{name}.xlsx"
            write_workbook(workbook, *formats)
            for kind in (CSV, "ods", "xls") if name == "german" else (CSV,):
                command = ["soffice", f"-env:UserInstallation=file://{folder}/user", "--headless", "--convert-to", kind]
                subprocess.run([*command, "--outdir", str(here), str(workbook)], check=True, capture_output=True)


if __name__ == "__main__":
    main()
