"""The diagnosis by the real engine over a real socket: asked for by a person, by a script, of a service that dies."""

import json
import time
from contextlib import closing
from pathlib import Path

import httpx2
import pytest

from storage import jobs
from storage.engine.opening import open_database
from tests.service.jobs.replaying import ended, processes, until_none
from tests.support import Server, clutchlife, post_tests, serving

BASE = "/v1/clutches/c1"


@pytest.mark.slow
def test_a_diagnosis_whose_service_is_killed_is_made_by_the_next(tmp_path: Path) -> None:
    server = Server(tmp_path / "clutchlife.db")
    server.start()
    server.http.post("/v1/clutches", json={"clutch_id": "c1"})
    post_tests(server.http, 0, 1000, 2000, 3000)
    answer = server.http.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": "wait=0"})
    assert (answer.status_code, answer.json()["status"]) == (202, "running")
    place = answer.headers["Location"]
    while not processes(server.address):
        time.sleep(0.02)
    server.kill()
    until_none(server.address)
    server.start()
    try:
        job = ended(server, place.rpartition("/")[2])
        assert (job["state"], job["attempts"]) == ("finished", 2), job
        post_tests(server.http, 4000)
        again = server.http.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=240"})
        assert (again.status_code, again.json()["status"]) == (201, "finished"), again.json()["problem"]
        assert [item["status"] for item in server.http.get(f"{BASE}/diagnoses").json()["items"]] == ["finished"] * 2
    finally:
        assert server.stop() in (0, -15)


def test_a_stop_does_not_wait_for_a_diagnosis(tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db") as server, httpx2.Client(base_url=server.url, timeout=60) as http:
        http.post("/v1/clutches", json={"clutch_id": "c1"})
        post_tests(http, 0, 1000, 2000)
        http.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=0"})
        while not processes(server.address):
            time.sleep(0.02)
        assert server.stop() in (0, -15)
        until_none(server.address)
    with closing(open_database(server.address)) as database, database.reading() as connection:
        assert [job.state for job in jobs.page(connection, limit=9)] == [jobs.WAITING]


def test_the_commands_print_and_export_what_json_holds_for_a_script(tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db", loaded=True) as server:
        at = ("--url", server.url)
        server.http.post("/v1/clutches", json={"clutch_id": "c1"})
        post_tests(server.http, 0, 1000, 2000, 3000)
        output = clutchlife("diagnose", "c1", *at)
        report = json.loads(clutchlife("diagnose", "c1", "--json", *at))
        assert "baseline" in clutchlife("model", "c1", "--baseline", *at)
        clutchlife("export", "c1", "--out", tmp_path / "export", *at)
        assert "there is no clutch" in clutchlife("diagnose", "nobody", *at, code=65)
        assert "not both" in clutchlife("model", "c1", "--baseline", "--adopt", "x", *at, code=64)
        assert "no diagnosis" in clutchlife("model", "c1", "--adopt", "x", *at, code=65)
    assert report["status"] == "finished"
    assert " ".join(report["summary"].split())[:40] in " ".join(output.replace("│", " ").split())
    results = tmp_path / "export" / "results"
    diagnoses = json.loads((results / "diagnoses.json").read_text())
    assert [each["verdict"] for each in diagnoses] == [report["verdict"]] * 2
    assert json.loads((results / "model.json").read_text())["model"]["name"] == "baseline"
