"""Inspections in the terminal: sent with their photographs, listed, exported; the service is in this process."""

import csv
import json
import zipfile
from pathlib import Path
from time import gmtime

import pytest
from fastapi.testclient import TestClient
from python_calamine import CalamineWorkbook

from service.cli.export import TABLES
from service.cli.workbook import write_workbook
from service.client.clutchlife import Client
from tests.service.cli.conftest import Terminal
from tests.service.web.routes.surfaces import png, sha256
from tests.support import clutchlife, serving, stationary

LIST = "/v1/clutches/c1/inspections"


def test_photographs_are_sent_and_repeated_safely(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(1))
    (tmp_path / "b.PNG").write_bytes(png(2))
    inspect = ("inspect", "c1", "--cycles", 11000, "--ra", 1.94, "--rsk", -3.4, "--lining", "side A")
    photographs = ("--at", "2026-11-02T08:00:00", "--photo", tmp_path / "a.png", "--photo", tmp_path / "b.PNG")
    for _ in range(2):
        shown = terminal(*inspect, *photographs)
        assert all(words in shown for words in ("11,000", "side A", "1.94", "-3.4", "accepted"))
        (stored,) = client.get(LIST).json()["items"]
        assert [photograph["photograph_id"] for photograph in stored["photographs"]] == [sha256(png(1)), sha256(png(2))]
        assert stored["performed_at"].startswith("2026-11-02T08:00:00")
    assert stored["inspection_id"] in terminal("inspections", "c1")
    assert json.loads(terminal("inspections", "c1", "--json")) == [stored]


def test_an_inspection_withdrawn_and_sent_again_stays_withdrawn(terminal: Terminal, client: TestClient) -> None:
    inspect = ("inspect", "c1", "--cycles", 11000, "--ra", 1.94)
    assert "withdrawn" not in terminal(*inspect)
    (stored,) = client.get(LIST).json()["items"]
    address = f"{LIST}/{stored['inspection_id']}"
    assert client.post(f"{address}/withdraw", json={"reason": "another disc"}).status_code == 200
    shown = terminal(*inspect)
    assert f"{stored['inspection_id']} was stored earlier and then withdrawn: it stays withdrawn" in shown
    assert client.get(address).json()["state"] == "withdrawn"


def test_a_photograph_alone_is_an_inspection_too(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    assert "c1 has no inspections" in terminal("inspections", "c1")
    (tmp_path / "a.png").write_bytes(png())
    terminal("inspect", "c1", "--cycles", 0, "--photo", tmp_path / "a.png")
    (stored,) = client.get(LIST).json()["items"]
    assert (stored["note"], len(stored["photographs"])) == ("photographs", 1)


def test_what_is_no_photograph_is_refused_unsent(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "a.gif").write_bytes(b"GIF89a")
    inspect = ("inspect", "c1", "--cycles", 0, "--ra", 9.5, "--photo")
    assert "the name of a photograph must end in .png" in terminal(*inspect, tmp_path / "a.gif", code=64)
    assert "does not exist" in terminal(*inspect, tmp_path / "b.png", code=64)
    assert "give roughness_um" in terminal("inspect", "c1", "--cycles", 0, code=65)
    assert client.get(LIST).json()["items"] == []


def test_an_export_holds_inspections_and_photographs(terminal: Terminal, client: TestClient, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png())
    for cycles in (0, 1000):
        terminal("inspect", "c1", "--cycles", cycles, "--ra", 9.5, "--photo", tmp_path / "a.png")
    assert client.post("/v1/clutches/c1/runs", json=stationary(0)).status_code == 201
    terminal("export", "c1", "--out", tmp_path / "export")
    results = tmp_path / "export" / "results"
    assert json.loads((results / "inspections.json").read_text()) == client.get(LIST).json()["items"]
    (file,) = (results / "photographs").iterdir()
    assert (file.name, file.read_bytes()) == (f"{sha256(png())}.png", png())


# --- An export says what it is of, has every table as spreadsheets take it, and may be one archive.


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
        rows = list(csv.reader((results / "tables" / f"{name}.csv").read_text(encoding="utf-8").splitlines()))
        sheet = book.get_sheet_by_name(name).to_python()
        assert len(sheet) == len(rows), name
        assert [str(cell) for cell in sheet[0]] == rows[0], name
    runs = book.get_sheet_by_name("runs").to_python()
    assert runs[2][runs[0].index("cycles")] == 1000.0


def test_a_workbook_computes_nothing_and_takes_any_text(tmp_path: Path) -> None:
    path = tmp_path / "a.xlsx"
    rows = [["=1+1", "1e3", "", "a<b & \x00c", "1_000", "nan"]]
    write_workbook(path, {"x" * 40: rows})
    book = CalamineWorkbook.from_path(str(path))
    assert book.sheet_names == ["x" * 31]
    assert book.get_sheet_by_index(0).to_python() == [["=1+1", 1000.0, "", "a<b & c", "1_000", "nan"]]


def test_the_same_tables_are_the_same_workbook_at_any_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written = []
    for seconds in (1_700_000_000.0, 1_800_000_000.0):
        monkeypatch.setattr("time.time", lambda at=seconds: at)
        monkeypatch.setattr("time.localtime", lambda _=None, at=seconds: gmtime(at))
        write_workbook(tmp_path / "a.xlsx", {"x": [["cycles", "mean_cof"], ["1000", ".13"]]})
        written.append((tmp_path / "a.xlsx").read_bytes())
    assert written[0] == written[1]
