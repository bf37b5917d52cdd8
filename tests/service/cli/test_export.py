"""An export says what it is of, has every table as spreadsheets take it, and may be one archive."""

import csv
import json
import zipfile
from pathlib import Path
from time import gmtime

import pytest
from python_calamine import CalamineWorkbook

from service.cli.export import TABLES
from service.cli.workbook import write_workbook
from service.client.clutchlife import Client
from tests.support import clutchlife, serving, stationary


def test_a_clutch_is_one_archive_with_its_tables(tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db", loaded=True) as server:
        with Client(server.url) as client:
            client.register("e")
            for cycles in (0.0, 1000.0, 2000.0, 3000.0):
                client.post_run("e", stationary(cycles))
            revision = client.clutch("e")["revision"]
        archive = tmp_path / "out" / "e.zip"
        clutchlife("export", "e", "--out", archive, "--archive", "--url", server.url)
    with zipfile.ZipFile(archive) as packed:
        packed.extractall(tmp_path / "unpacked")
    results = tmp_path / "unpacked" / "e" / "results"
    about = json.loads((results / "about.json").read_text(encoding="utf-8"))
    assert about["revision"] == revision
    assert about["settings"]["clutch_id"] == "e"
    assert about["release"]
    assert [run["cycles"] for run in about["data"]] == [0, 1000, 2000, 3000]
    assert all(len(run["content_sha256"]) == 64 for run in about["data"])
    book = CalamineWorkbook.from_path(str(results / "tables.xlsx"))
    assert book.sheet_names == list(TABLES)
    for name in TABLES:
        rows = rows_of(results, name)
        sheet = book.get_sheet_by_name(name).to_python()
        assert len(sheet) == len(rows), name
        assert [str(cell) for cell in sheet[0]] == rows[0], name
    assert book.get_sheet_by_name("runs").to_python()[2][rows_of(results, "runs")[0].index("cycles")] == 1000.0


def rows_of(results: Path, name: str) -> list[list[str]]:
    """The rows of a table, its header first."""
    with (results / "tables" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))


def test_a_workbook_computes_nothing_and_takes_any_text(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    rows = [["=1+1", "1e3", "", "a<b & \x00c", "1_000", "nan"]]
    write_workbook(path, {"x" * 40: rows})
    book = CalamineWorkbook.from_path(str(path))
    assert book.sheet_names == ["x" * 31]
    assert book.get_sheet_by_index(0).to_python() == [["=1+1", 1000.0, "", "a<b & c", "1_000", "nan"]]


def test_the_same_tables_are_the_same_workbook_whenever_they_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = []
    for seconds in (1_700_000_000.0, 1_800_000_000.0):
        monkeypatch.setattr("time.time", lambda at=seconds: at)
        monkeypatch.setattr("time.localtime", lambda _=None, at=seconds: gmtime(at))
        write_workbook(tmp_path / "a.xlsx", {"x": [["cycles", "mean_cof"], ["1000", ".13"]]})
        written.append((tmp_path / "a.xlsx").read_bytes())
    assert written[0] == written[1]
