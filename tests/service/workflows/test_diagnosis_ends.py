"""Diagnoses that break, run beside others, or lose their service; with an engine that stands in for the real one."""

import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.schemas.diagnosis import DiagnosisOut, JobPage
from service.work.queue import MAX_ATTEMPTS
from service.workflows import adopt_model
from tests.service.workflows.diagnosing import BASE, diagnosed, post_tests, service, stood_in


@pytest.fixture(scope="module", autouse=True)
def _stand_in() -> Iterator[None]:
    with stood_in():
        yield


@pytest.mark.parametrize(
    ("engine", "problem"),
    [
        pytest.param("killed", "SIGKILL", marks=pytest.mark.slow),
        ("raising", "status 1"),
        pytest.param("greedy", "memory", marks=pytest.mark.slow),
        pytest.param("computing", "longer than 4 s of processor time", marks=pytest.mark.slow),
        pytest.param("endless", "longer than 6 s by the clock", marks=pytest.mark.slow),
    ],
)
def test_a_diagnosis_that_breaks_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, engine: str, problem: str
) -> None:
    if engine == "endless":
        monkeypatch.setattr("service.work.queue.CLOCK_PER_PROCESSOR_SECOND", 0.05)
    with service(tmp_path, engine, diagnosis_seconds=4 if engine == "computing" else 120) as client:
        answer = client.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": "wait=120"})
        DiagnosisOut.model_validate(answer.json())
        assert (answer.status_code, answer.json()["status"], answer.json()["verdict"]) == (201, "failed", None)
        assert problem in answer.json()["problem"]
        assert client.get(f"{BASE}/model").json()["version"] == 0
    if engine == "raising":  # a bug is in the log with its traceback
        assert logged(caplog, "RuntimeError: it broke") == ["ERROR"]


def logged(caplog: pytest.LogCaptureFixture, said: str) -> list[str]:
    """The levels of what is said of diagnoses in the log, each with those words and a line of the engine."""
    found = [record for record in caplog.records if record.getMessage().startswith("diagnosis ")]
    assert all(said in record.getMessage() and "stand_in_engine.py" in record.getMessage() for record in found)
    return [record.levelname for record in found]


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "levels"), [("overflowing", ["WARNING"]), ("diagnose", [])])
def test_what_goes_wrong_in_a_diagnosis_is_in_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, engine: str, levels: list[str]
) -> None:
    """A number that ran over with its line; of one that went well, nothing."""
    with service(tmp_path, engine) as client:
        answer = client.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=120"})
        assert answer.json()["status"] == "finished"
    assert logged(caplog, "RuntimeWarning: overflow encountered") == levels


def test_one_runs_at_a_time_others_join_or_wait_or_are_sent_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STAND_IN_PID", str(tmp_path / "pid"))
    with service(tmp_path, "endless", most_diagnoses=2) as client:
        first = client.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=0"})
        assert (first.status_code, first.json()["status"], first.headers["Preference-Applied"]) == (
            202,
            "running",
            "wait=0",
        )
        again = client.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": 'wait="0"'})
        assert (again.status_code, again.headers["Location"]) == (202, first.headers["Location"])
        post_tests(client, 0)
        other = client.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=0"})
        assert (other.status_code, other.json()["revision"]) == (202, 1)
        client.post("/v1/clutches", json={"clutch_id": "c2"})
        away = client.post("/v1/clutches/c2/diagnoses", json={}, headers={"Prefer": "wait=0"})
        assert (away.status_code, away.headers["Retry-After"]) == (503, "1")
        assert client.get("/v1/clutches/c2/diagnoses").json()["items"] == []
        pages = client.get(f"{BASE}/diagnoses", params={"limit": 1}).json()
        rest = client.get(f"{BASE}/diagnoses", params={"limit": 1, "cursor": pages["next"]}).json()
        assert [page["items"][0]["diagnosis_id"] for page in (pages, rest)] == [
            other.json()["diagnosis_id"],
            first.json()["diagnosis_id"],
        ]
        assert rest["next"] is None
        deadline = time.monotonic() + 60
        while not (tmp_path / "pid").exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)
        process = int((tmp_path / "pid").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    monkeypatch.delenv("STAND_IN_PID")
    with service(tmp_path) as client:
        assert [ended(client, each.json()["diagnosis_id"])["status"] for each in (first, other)] == ["finished"] * 2
        found = client.get("/v1/jobs").json()["items"]
        assert [(each["state"], each["attempts"]) for each in found] == [("finished", 1)] * 2


def ended(client: TestClient, diagnosis_id: str) -> dict[str, Any]:
    """The diagnosis once it has ended."""
    deadline = time.monotonic() + 60
    while True:
        found: dict[str, Any] = client.get(f"{BASE}/diagnoses/{diagnosis_id}").json()
        if found["status"] != "running":
            return found
        assert time.monotonic() < deadline, "it has not ended"
        time.sleep(0.05)


def left_running(folder: Path, *, attempts: int) -> None:
    """Change a finished diagnosis into one that a killed service has left running."""
    with closing(sqlite3.connect(folder / "a.db")) as connection, connection:
        connection.execute("UPDATE diagnosis SET status = 'running', report = NULL, finished_at = NULL")
        connection.execute(
            "UPDATE job SET state = 'running', claimed_by = 'dead', leased_until = 1e12, finished_at = NULL, attempts = ?",
            (attempts,),
        )


def test_what_a_dead_service_left_running_is_made_by_the_next(tmp_path: Path) -> None:
    """And of a clutch without a test there is nothing to adopt."""
    with service(tmp_path) as client:
        report = diagnosed(client, adopt=True)
        assert (report["verdict"], report["adopted"], report["as_of_cycles"]) == ("model_adequate", False, None)
        refused = client.put(f"{BASE}/model", json={"diagnosis_id": report["diagnosis_id"]})
        assert (refused.status_code, refused.headers["Content-Type"]) == (409, "application/problem+json")
        assert refused.json()["title"] == "There is nothing to adopt"
        assert client.get(f"{BASE}/model").json()["versions"] == []
    left_running(tmp_path, attempts=1)
    with service(tmp_path) as client:
        again = ended(client, report["diagnosis_id"])
        assert again | {"finished_at": ""} == report | {"finished_at": ""}
        assert client.get(f"/v1/jobs/{report['diagnosis_id']}").json()["attempts"] == 2


@pytest.mark.slow
def test_what_ends_the_service_again_and_again_is_given_up(tmp_path: Path) -> None:
    with service(tmp_path) as client:
        report = diagnosed(client)
    left_running(tmp_path, attempts=MAX_ATTEMPTS)
    with service(tmp_path) as client:
        found = ended(client, report["diagnosis_id"])
        assert (found["status"], "ended 3 times" in found["problem"]) == ("failed", True)
        assert client.get(f"/v1/jobs/{report['diagnosis_id']}").json()["state"] == "failed"


@pytest.mark.slow
def test_who_joins_a_diagnosis_that_runs_has_it_adopted(tmp_path: Path) -> None:
    with service(tmp_path, "slow") as client:
        post_tests(client, 0, 1000, 2000)
        first = client.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=0"})
        joined = client.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": "wait=120"})
        assert joined.json()["diagnosis_id"] == first.json()["diagnosis_id"]
        assert (joined.status_code, joined.json()["adopted"]) == (201, True)
        assert client.get(f"{BASE}/model").json()["version"] == 1


@pytest.mark.slow
def test_a_job_is_held_while_what_it_found_is_adopted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else another service would begin it again, and neither come to its end."""
    adopted, left = adopt_model.finish_and_adopt, []

    def slowly(*arguments: Any, **named: Any) -> bool:
        time.sleep(2.5)
        with closing(sqlite3.connect(tmp_path / "a.db")) as connection:
            left.append(connection.execute("SELECT leased_until FROM job").fetchone()[0] - time.time())
        return adopted(*arguments, **named)

    monkeypatch.setattr(adopt_model, "finish_and_adopt", slowly)
    with service(tmp_path, job_lease_seconds=2) as client:
        post_tests(client, 0, 1000, 2000)
        assert diagnosed(client, adopt=True)["adopted"]
    assert left[0] > 0


def test_a_job_is_shown_and_cancelled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one that runs is ended with its process, the one that waits is not begun; both are failed diagnoses."""
    monkeypatch.setenv("STAND_IN_PID", str(tmp_path / "pid"))
    with service(tmp_path, "endless", job_lease_seconds=1) as client:
        ids = []
        for cycles in (0, 1000):
            post_tests(client, cycles)
            answer = client.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=0"})
            ids.append(answer.json()["diagnosis_id"])
        deadline = time.monotonic() + 60
        while client.get(f"/v1/jobs/{ids[0]}").json()["progress"] != {"step": "diagnoses"}:
            assert time.monotonic() < deadline
            time.sleep(0.05)
        while not (tmp_path / "pid").exists():
            time.sleep(0.05)
        process = int((tmp_path / "pid").read_text())
        listed = client.get("/v1/jobs").json()
        JobPage.model_validate(listed)
        assert [(each["job_id"], each["state"]) for each in listed["items"]] == [
            (ids[1], "waiting"),
            (ids[0], "running"),
        ]
        assert [each["job_id"] for each in client.get("/v1/jobs?state=waiting").json()["items"]] == [ids[1]]
        page = client.get("/v1/jobs?limit=1").json()
        assert client.get("/v1/jobs", params={"cursor": page["next"]}).json()["items"] == listed["items"][1:]
        for job_id in (ids[1], ids[0]):
            cancelled = client.delete(f"/v1/jobs/{job_id}")
            assert (cancelled.status_code, cancelled.json()["state"]) == (200, "cancelled")
            assert cancelled.json()["problem"] == "cancelled by local"
            found = ended(client, job_id)
            assert (found["status"], found["problem"]) == ("failed", "cancelled by local")
        while Path(f"/proc/{process}").exists():
            assert time.monotonic() < deadline, "its process goes on"
            time.sleep(0.05)
        assert client.delete(f"/v1/jobs/{ids[0]}").json() == client.get(f"/v1/jobs/{ids[0]}").json()
        for method in ("GET", "DELETE"):
            assert client.request(method, "/v1/jobs/nothing").status_code == 404
