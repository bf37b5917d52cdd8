"""The diagnosis by the real engine over a real socket: asked for by a person, by a script, of a service that dies."""

import json
import time
from pathlib import Path

import httpx2
import pytest

from tests.service.work.replaying import ended, processes, until_none
from tests.support import Server, clutchlife, serving, stationary

BASE = "/v1/clutches/c1"


def post_tests(http: httpx2.Client, *cycles: float) -> None:
    http.post("/v1/clutches", json={"clutch_id": "c1"})
    for count in cycles:
        assert http.post(f"{BASE}/runs", json=stationary(count, run_id=f"r{count:g}")).status_code == 201


@pytest.mark.slow
def test_a_diagnosis_whose_service_is_killed_is_made_by_the_next(tmp_path: Path) -> None:
    server = Server(tmp_path / "clutchlife.db")
    server.start()
    with httpx2.Client(base_url=server.url, timeout=60) as http:
        post_tests(http, 0, 1000, 2000, 3000)
        answer = http.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": "wait=0"})
        assert (answer.status_code, answer.json()["status"]) == (202, "running")
        place = answer.headers["Location"]
        while not processes(server.address):
            time.sleep(0.02)
        server.kill()
    until_none(server.address)
    server.start()
    try:
        with httpx2.Client(base_url=server.url, timeout=300) as http:
            job = ended(server, place.rpartition("/")[2])
            assert (job["state"], job["attempts"]) == ("finished", 2), job
            post_tests(http, 4000)
            again = http.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=240"})
            assert (again.status_code, again.json()["status"]) == (201, "finished"), again.json()["problem"]
            assert [item["status"] for item in http.get(f"{BASE}/diagnoses").json()["items"]] == ["finished"] * 2
    finally:
        assert server.stop() in (0, -15)


def test_a_stop_does_not_wait_for_a_diagnosis(tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db") as server, httpx2.Client(base_url=server.url, timeout=60) as http:
        post_tests(http, 0, 1000, 2000)
        http.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=0"})
        while not processes(server.address):
            time.sleep(0.02)
        began = time.monotonic()
        assert server.stop() in (0, -15)
        assert time.monotonic() - began < 15
        until_none(server.address)


@pytest.fixture(scope="module")
def commanded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """What `clutchlife diagnose` prints of four tests, for a person and as JSON; and what `export` writes."""
    folder = tmp_path_factory.mktemp("commanded")
    with serving(folder / "clutchlife.db", loaded=True) as server:
        with httpx2.Client(base_url=server.url, timeout=60) as http:
            post_tests(http, 0, 1000, 2000, 3000)
        output = clutchlife("diagnose", "c1", "--url", server.url)
        (folder / "report.json").write_text(clutchlife("diagnose", "c1", "--json", "--url", server.url))
        (folder / "model.txt").write_text(clutchlife("model", "c1", "--baseline", "--url", server.url))
        clutchlife("export", "c1", "--out", str(folder / "export"), "--url", server.url)
        assert "there is no clutch" in clutchlife("diagnose", "nobody", "--url", server.url, code=65)
        assert "not both" in clutchlife("model", "c1", "--baseline", "--adopt", "x", "--url", server.url, code=64)
        assert "no diagnosis" in clutchlife("model", "c1", "--adopt", "x", "--url", server.url, code=65)
    return folder, output


def test_the_command_prints_for_a_person_what_json_holds_for_a_script(commanded: tuple[Path, str]) -> None:
    folder, output = commanded
    report = json.loads((folder / "report.json").read_text())
    assert report["status"] == "finished"
    assert " ".join(report["summary"].split())[:40] in " ".join(output.replace("│", " ").split())
    assert "baseline" in (folder / "model.txt").read_text()


def test_what_is_exported_holds_the_diagnoses(commanded: tuple[Path, str]) -> None:
    folder, _ = commanded
    diagnoses = json.loads((folder / "export" / "results" / "diagnoses.json").read_text())
    report = json.loads((folder / "report.json").read_text())
    assert len(diagnoses) == 2
    assert diagnoses[0]["verdict"] == report["verdict"]
    assert json.loads((folder / "export" / "results" / "model.json").read_text())["model"]["name"] == "baseline"
