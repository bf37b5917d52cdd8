"""Diagnoses that break, run beside others, or lose their service; with an engine that stands in for the real one."""

import os
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from models.diagnosis.extension import Extension
from service.schemas.diagnosis import DiagnosisOut
from tests.service.workflows import stand_in_engine
from tests.service.workflows.diagnosing import BASE, diagnosed, post_tests, service


@pytest.fixture(autouse=True)
def _stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, method in stand_in_engine.METHODS.items():
        monkeypatch.setattr(Extension, name, method)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))


@pytest.mark.parametrize(
    ("engine", "problem"),
    [
        ("killed", "SIGKILL"),
        ("raising", "status 1"),
        ("greedy", "memory"),
        ("computing", "longer than 4 s of processor time"),
        ("endless", "longer than 6 s by the clock"),
    ],
)
def test_a_diagnosis_that_breaks_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, engine: str, problem: str
) -> None:
    if engine == "endless":
        monkeypatch.setattr("service.jobs.queue.CLOCK_PER_PROCESSOR_SECOND", 0.05)
    with service(tmp_path, engine, diagnosis_seconds=4 if engine == "computing" else 120) as client:
        answer = client.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": "wait=120"})
        DiagnosisOut.model_validate(answer.json())
        assert (answer.status_code, answer.json()["status"], answer.json()["verdict"]) == (201, "failed", None)
        assert problem in answer.json()["problem"]
        assert client.get(f"{BASE}/model").json()["version"] == 0


@pytest.mark.parametrize(
    ("engine", "status", "level", "said"),
    [
        ("raising", "failed", "ERROR", "RuntimeError: it broke"),
        ("overflowing", "finished", "WARNING", "RuntimeWarning: overflow encountered"),
        ("diagnose", "finished", "", ""),
    ],
)
def test_what_goes_wrong_in_a_diagnosis_is_in_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, engine: str, status: str, level: str, said: str
) -> None:
    """A bug with its traceback, a number that ran over with its line; of one that went well, nothing."""
    with service(tmp_path, engine) as client:
        answer = client.post(f"{BASE}/diagnoses", json={}, headers={"Prefer": "wait=120"})
        assert answer.json()["status"] == status
    logged = [record for record in caplog.records if record.getMessage().startswith("diagnosis ")]
    assert [record.levelname for record in logged] == ([level] if level else [])
    assert all(said in record.getMessage() for record in logged)
    assert all("stand_in_engine.py" in record.getMessage() for record in logged)


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
    with service(tmp_path) as client:
        found = client.get(f"{BASE}/diagnoses").json()["items"]
        assert [(each["status"], "ask again" in each["problem"]) for each in found] == [("failed", True)] * 2


def test_what_a_dead_service_left_running_is_told_at_the_next_start(tmp_path: Path) -> None:
    with service(tmp_path) as client:
        report = diagnosed(client)
    with closing(sqlite3.connect(tmp_path / "a.db")) as connection, connection:
        connection.execute("UPDATE diagnosis SET status = 'running', report = NULL, finished_at = NULL")
    with service(tmp_path) as client:
        found = client.get(f"{BASE}/diagnoses/{report['diagnosis_id']}").json()
        assert (found["status"], "ask again" in found["problem"]) == ("failed", True)
        assert diagnosed(client)["diagnosis_id"] != report["diagnosis_id"]
