"""The diagnosis through the service, with an engine that stands in: asked for, stored, adopted, refused, broken, lost."""

import os
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from fastapi.testclient import TestClient

from models.diagnosis.extension import Extension, NotFiniteError
from models.rig.campaign import planned, simulated_clutch
from models.rig.programme import Ageing
from models.rig.stationary import Sensor
from service.api.diagnosis import DiagnosisListed, DiagnosisOut, IsolabilityOut, JobPage, ModelOut, PlanOut
from service.changes import adopt_model
from service.clutch.tracking import METHODS
from service.jobs import diagnosis as process
from service.jobs.queue import MAX_ATTEMPTS
from service.runs.simulated import planned_tests, simulated_body
from storage.engine.opening import open_database
from tests.service.changes import stand_in_engine
from tests.service.clients import client_on, post_run
from tests.service.jobs.replaying import replay_clutch
from tests.service.jobs.waiting import until
from tests.storage.samples import reseal
from tests.support import post_tests

BASE = "/v1/clutches/c1"
RUL = f"{BASE}/remaining-useful-life"
EFFECTS = ["torque_zero_shift", "running_in"]
EXTENDED = {"name": "extended", "effects": EFFECTS}
BASELINE = {"name": "baseline", "effects": []}


@pytest.fixture(scope="module", autouse=True)
def _stand_in() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        stand_in_engine.apply(patched.setattr)
        yield


@contextmanager
def service(folder: Path, engine: str = "diagnose", **settings: Any) -> Iterator[TestClient]:
    """A service in this process, whose diagnoses the stand-in makes."""
    engine = f"{stand_in_engine.__name__}:{engine}"
    with client_on(f"sqlite:///{folder / 'a.db'}", engine=engine, **settings) as client:
        client.post("/v1/clutches", json={"clutch_id": "c1"})
        yield client


def asked(client: TestClient, wait: int = 0, clutch: str = "c1", **body: Any) -> Any:
    """The answer to a request for a diagnosis."""
    return client.post(f"/v1/clutches/{clutch}/diagnoses", json=body, headers={"Prefer": f"wait={wait}"})


def diagnosed(client: TestClient, **body: Any) -> dict[str, Any]:
    answer = asked(client, 120, **body)
    assert answer.status_code == 201, answer.text
    found: dict[str, Any] = answer.json()
    assert found["status"] == "finished", found["problem"]
    return found


def adopt(client: TestClient, diagnosis_id: str | None) -> Any:
    """The answer to a request that a diagnosis be adopted, or the baseline (None)."""
    return client.put(f"{BASE}/model", json={"diagnosis_id": diagnosis_id})


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    with service(tmp_path) as found:
        yield found


@pytest.fixture(scope="module")
def laid(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The file of a clutch with five tests and a diagnosis of them, and the diagnosis' id."""
    folder = tmp_path_factory.mktemp("diagnosed")
    with service(folder) as found:
        post_tests(found, 0, 1000, 2000, 3000, 4000)
        return folder / "a.db", str(diagnosed(found)["diagnosis_id"])


@pytest.fixture
def examined(laid: tuple[Path, str], tmp_path: Path) -> Iterator[tuple[TestClient, str]]:
    """A service on a copy of it."""
    shutil.copyfile(laid[0], tmp_path / "a.db")
    with service(tmp_path) as found:
        yield found, laid[1]


def said(client: TestClient) -> list[Any]:
    """All that is said of the clutch, but for its revision."""
    names = ("remaining-useful-life?method=grid", "remaining-useful-life?method=ukf", "degradation", "series")
    past = f"{RUL}?at_cycles=2500"
    return [client.get(at).json() | {"revision": 0} for at in (RUL, past, *(f"{BASE}/{name}" for name in names))]


def test_a_report_is_answered_stored_and_listed(client: TestClient) -> None:
    post_tests(client, 0, 1000, 2000, 3000)
    answer = client.post(f"{BASE}/diagnoses", json={"adopt": False}, headers={"Prefer": "respond-async, wait=120"})
    assert (answer.status_code, answer.headers["Preference-Applied"]) == (201, "wait=120")
    report = answer.json()
    DiagnosisOut.model_validate(report)
    assert answer.headers["Location"] == f"{BASE}/diagnoses/{report['diagnosis_id']}"
    assert (report["verdict"], report["causes"], report["as_of_cycles"]) == ("cause_named", EFFECTS, 3000)
    assert (report["adoptable"], report["adopted"], report["stale"]) == (True, False, False)
    estimate = {"name": "zero shift", "value": 1.5, "sd": None, "unit": "Nm", "interval": [None, None]}
    assert report["candidates"][0]["estimate"] == estimate
    assert report["statistics"] == {"alarm": None, "threshold": 11.0}
    assert report["maps"]["axes"]["pressure_bar"] == [4.0, 5.0]
    assert report["maps"]["axes"]["speed_rpm"][0] == pytest.approx(95.493)
    assert report["maps"]["before"]["speed_pressure"] == [[None, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert len(report["maps"]["before"]["pressure_cycles"]) == 3
    assert report["gain"]["held_out_runs"] == ["r3000"]
    kept = client.get(answer.headers["Location"])
    assert kept.json() == report
    again = client.get(answer.headers["Location"], headers={"If-None-Match": kept.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")
    listed = client.get(f"{BASE}/diagnoses").json()
    DiagnosisListed.model_validate(listed["items"][0])
    shown = {k: v for k, v in report.items() if k not in ("maps", "loops", "law_curves", "isolability")}
    assert listed == {"items": [shown], "next": None}
    post_tests(client, 4000)
    assert client.get(answer.headers["Location"]).json() == report | {"stale": True}


def test_the_plan_of_a_diagnosis_is_a_protocol_that_a_rig_can_run(
    examined: tuple[TestClient, str], tmp_path: Path
) -> None:
    """The circle: diagnose, the plan as a file, its tests on the simulated rig, sent, so that a next diagnosis has them.
    With the real engine tests/documents/test_pages.py goes round it."""
    client, diagnosis_id = examined
    at = f"{BASE}/diagnoses/{diagnosis_id}"
    plan = client.get(f"{at}/plan")
    PlanOut.model_validate(plan.json())
    (test,) = plan.json()["tests"]
    assert (test["probability"], test["minutes"], test["separates"]) == (0.9, 12.3, ["torque_zero_shift", "baseline"])
    (step,) = test["steps"]
    assert (step["pressures_bar"], step["speeds_rpm"]) == ([0.0, 4.0], [95.49, 190.99])
    assert (step["oil_temperature_c"], step["repeats"], step["pause_hours"]) == (60.0, 5, 2.0)
    table = client.get(f"{at}/plan.csv")
    assert table.headers["content-type"].startswith("text/csv")
    header, row = table.text.splitlines()
    assert header.split(",")[:5] == ["test", "choice", "step", "kind", "pressures_bar"]
    assert row.startswith("1,one of 1 is enough,1,stationary_stribeck,0 4,95.49 190.99,")
    assert client.get(f"{BASE}/diagnoses/unknown/plan").status_code == 404

    (tmp_path / "plan.csv").write_text(table.text, "utf-8")
    (tmp_path / "plan.json").write_text(plan.text, "utf-8")
    tests = planned_tests(tmp_path / "plan.csv", 1)
    assert tests == planned_tests(tmp_path / "plan.json", 1)
    rig = {"clutch": simulated_clutch(7), "sensor": Sensor(), "ageing": Ageing.CYCLES, "cycles": 4000, "wear": 4000.0}
    sent = [post_run(client, simulated_body(run))["run_id"] for run in planned(7, tests, **rig)]
    confirmed = client.post(f"{BASE}/runs/confirm", json={"run_ids": sent, "reason": "so slow a test was asked for"})
    assert confirmed.status_code == 200
    assert client.get(at).json()["stale"]


def test_what_is_adopted_moves_every_answer_and_back_again(
    examined: tuple[TestClient, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    client, diagnosis_id = examined
    before, receipts = said(client), client.get(f"{BASE}/runs").json()
    report = client.get(f"{BASE}/diagnoses/{diagnosis_id}").json()
    life = report["gain"]["remaining_useful_life"]
    shown = client.get(RUL).json()
    assert life["before"] == {name: shown[name] for name in life["before"]}
    adopted = adopt(client, diagnosis_id)
    ModelOut.model_validate(adopted.json())
    assert (adopted.status_code, adopted.json()["model"], adopted.json()["version"]) == (200, EXTENDED, 1)
    after = client.get(RUL).json()
    assert {name: after[name] for name in life["after"]} == life["after"]
    assert after["model"] == EXTENDED
    # 1.5 Nm fewer in the last three tests: the clutch has aged further than the baseline says
    assert after["current"]["mean_cof"] < 0.95 * shown["current"]["mean_cof"]
    listed = client.get("/v1/clutches").json()["items"][0]["summary"]
    assert (listed["current"], listed["model"]) == (after["current"], EXTENDED)
    corrected = "Corrected: the torque sensor reads 1.5 Nm too much. Zero the torque sensor before each test."
    assert client.get(BASE).json()["action"] == corrected
    for at in ("degradation", "engagement", "remaining-useful-life?method=ukf&pressure_bar=5&at_cycles=2500"):
        assert client.get(f"{BASE}/{at}").json()["model"] == EXTENDED, at
    assert client.get(f"{BASE}/runs").json() == receipts
    assert adopt(client, diagnosis_id).json() == adopted.json() == client.get(f"{BASE}/model").json()
    assert client.get(f"{BASE}/diagnoses/{diagnosis_id}").json()["adopted"]
    back = adopt(client, None).json()
    assert (back["model"], back["version"], [row["version"] for row in back["versions"]]) == (BASELINE, 2, [2, 1])
    assert said(client) == before
    # a run is taken whatever the model makes of it
    assert adopt(client, diagnosis_id).status_code == 200
    for number, error in enumerate((KeyError, ValueError, NotFiniteError)):
        monkeypatch.setattr(Extension, "artefact", Mock(side_effect=error("a model that breaks")))
        post_tests(client, 5000 + 1000 * number)
        assert client.get(RUL).json()["runs_used"] == 6 + number


@pytest.mark.slow
def test_the_order_of_arrival_does_not_matter_under_a_model_and_replay_gives_the_same(tmp_path: Path) -> None:
    oil = {"kind": "maintenance", "event": "oil_change", "cycles": 2500, "run_id": "oil"}
    answers = []
    for name, rest in (
        ("in-order", ("adopt", "oil", 3000, 4000)),
        ("late", ("adopt", 4000, 3000, "oil")),
        ("before", ("oil", 3000, 4000, "adopt")),
    ):
        (tmp_path / name).mkdir()
        with service(tmp_path / name) as client:
            post_tests(client, 0, 1000, 2000)
            report = diagnosed(client)
            for each in rest:
                if each == "oil":
                    post_run(client, oil)
                elif each == "adopt":
                    assert adopt(client, report["diagnosis_id"]).status_code == 200
                else:
                    post_tests(client, float(each))
            answers.append(said(client))
            with closing(open_database(f"sqlite:///{tmp_path / name / 'a.db'}")) as database:
                assert replay_clutch(database, "c1") == 6
            assert said(client) == answers[-1]
    for rows in answers:
        for row in rows[-1]["items"]:
            row["time"] = None
    assert answers[0] == answers[1] == answers[2]
    assert answers[0][0]["model"] == EXTENDED


@pytest.mark.slow
def test_a_rebuild_ends_the_model(client: TestClient) -> None:
    post_tests(client, 0, 1000, 2000)
    report = diagnosed(client, adopt=True)
    assert report["adopted"]
    assert client.get(RUL).json()["model"] == EXTENDED
    post_run(client, {"kind": "maintenance", "event": "rebuild", "cycles": 2000, "run_id": "rebuild"})
    assert client.get(RUL).json()["model"] == BASELINE
    assert client.get(f"{BASE}/model").json()["model"] == BASELINE
    kept = client.get(f"{BASE}/diagnoses/{report['diagnosis_id']}").json()
    assert (kept["adoptable"], kept["adopted"], kept["stale"], kept["earlier_life"]) == (False, False, True, True)
    listed = client.get(BASE).json()["diagnosis"]
    assert (listed["adopted"], listed["earlier_life"]) == (False, True)
    refused = adopt(client, report["diagnosis_id"])
    assert (refused.status_code, "rebuild" in refused.json()["detail"]) == (409, True)
    post_tests(client, 2500, 3500)
    assert "looked at 2 tests" in diagnosed(client, adopt=True)["summary"]
    assert client.get(RUL).json()["model"] == BASELINE
    assert client.get(BASE).json()["diagnosis"]["earlier_life"] is False


def test_what_is_unknown_or_wrong_is_refused(client: TestClient) -> None:
    assert adopt(client, "nothing").status_code == 404
    assert client.get(f"{BASE}/diagnoses/nothing").status_code == 404
    for method, at in (("GET", "diagnoses"), ("POST", "diagnoses"), ("GET", "model"), ("PUT", "model")):
        body = {} if method == "POST" else {"diagnosis_id": None}
        answer = client.request(method, f"/v1/clutches/nobody/{at}", json=body if method != "GET" else None)
        assert answer.status_code == 404, (method, at)
    assert client.post(f"{BASE}/diagnoses", json={"adopt": 1}).status_code == 422
    for body in ({}, {"diagnosis_id": 7}, {"diagnosis_id": ""}):
        assert client.put(f"{BASE}/model", json=body).status_code == 422, body
    assert client.post(f"{BASE}/diagnoses", content=b"{}", headers={"Content-Type": "text/plain"}).status_code == 415
    assert client.get(f"{BASE}/diagnoses").json() == {"items": [], "next": None}


def test_the_same_runs_under_another_name_get_the_same_report_and_remaining_life(tmp_path: Path) -> None:
    """What is drawn was seeded by the clutch's name, and a verdict hung on it."""
    with service(tmp_path) as client:
        client.post("/v1/clutches", json={"clutch_id": "c2"})
        for clutch in ("c1", "c2"):
            post_tests(client, 0.0, 1000.0, 2000.0, to=clutch)
        for method in METHODS:
            address = f"/v1/clutches/{{}}/remaining-useful-life?method={method}"
            one, other = (client.get(address.format(clutch)).json() for clutch in ("c1", "c2"))
            assert one["status"] != "insufficient_data"
            for part in ("remaining_cycles", "current"):
                assert one[part] == other[part]

    def made(clutch: str, engine: str = "diagnose", *, isolability: bool = False) -> Any:
        engine = f"{stand_in_engine.__name__}:{engine}"
        named = {"database": f"sqlite:///{tmp_path / 'a.db'}", "clutch_id": clutch, "engine": engine}
        return process.diagnosed(
            process.DiagnosisTask(**named, last_run_key=10**9, bytes=0, processor_seconds=0, isolability=isolability)
        )

    found = [made(clutch) for clutch in ("c1", "c2")]
    assert found[0]["extension"]["content"]["drawn"] == found[1]["extension"]["content"]["drawn"]
    assert found[0]["report"]["summary"] == found[1]["report"]["summary"]
    report = made("c1", "separating", isolability=True)["report"]
    said = IsolabilityOut.model_validate(report["isolability"])
    assert (said.unseen, said.pairs[0].key, said.pairs[0].with_test) == (["channel_delay"], "open_sweep", 0.98)
    assert found[0]["report"]["isolability"] is None


# --- Diagnoses that break, run beside others, or lose their service; with an engine that stands in for the real one.


@pytest.mark.parametrize(
    ("engine", "problem"),
    [
        pytest.param("killed", "SIGKILL", marks=pytest.mark.slow),
        ("raising", "status 1"),
        pytest.param("greedy", "memory", marks=pytest.mark.slow),
        pytest.param("computing", "longer than 4 s of processor time", marks=pytest.mark.slow),
        pytest.param("endless", "longer than 6 s", marks=pytest.mark.slow),
    ],
)
def test_a_diagnosis_that_breaks_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, engine: str, problem: str
) -> None:
    if engine == "endless":
        monkeypatch.setattr("service.jobs.queue.CLOCK_PER_PROCESSOR_SECOND", 0.05)
    with service(tmp_path, engine, diagnosis_seconds=4 if engine == "computing" else 120) as client:
        answer = asked(client, 120, adopt=True)
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
        diagnosed(client)
    assert logged(caplog, "RuntimeWarning: overflow encountered") == levels


def test_one_runs_at_a_time_others_join_or_wait_or_are_sent_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STAND_IN_PID", str(tmp_path / "pid"))
    with service(tmp_path, "endless", most_diagnoses=2) as client:
        first = asked(client)
        assert (first.status_code, first.json()["status"]) == (202, "running")
        assert first.headers["Preference-Applied"] == "wait=0"
        again = client.post(f"{BASE}/diagnoses", json={"adopt": True}, headers={"Prefer": 'wait="0"'})
        assert (again.status_code, again.headers["Location"]) == (202, first.headers["Location"])
        post_tests(client, 0)
        other = asked(client)
        assert (other.status_code, other.json()["revision"]) == (202, 1)
        client.post("/v1/clutches", json={"clutch_id": "c2"})
        away = asked(client, clutch="c2")
        assert (away.status_code, away.headers["Retry-After"]) == (503, "1")
        assert client.get("/v1/clutches/c2/diagnoses").json()["items"] == []
        pages = client.get(f"{BASE}/diagnoses", params={"limit": 1}).json()
        rest = client.get(f"{BASE}/diagnoses", params={"limit": 1, "cursor": pages["next"]}).json()
        ids = [answer.json()["diagnosis_id"] for answer in (first, other)]
        assert [page["items"][0]["diagnosis_id"] for page in (rest, pages)] == ids
        assert rest["next"] is None
        until((tmp_path / "pid").exists)
        process = int((tmp_path / "pid").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    monkeypatch.delenv("STAND_IN_PID")
    with service(tmp_path) as client:
        assert [ended(client, each)["status"] for each in ids] == ["finished"] * 2
        found = client.get("/v1/jobs").json()["items"]
        assert [(each["state"], each["attempts"]) for each in found] == [("finished", 1)] * 2


def ended(client: TestClient, diagnosis_id: str) -> dict[str, Any]:
    """The diagnosis once it has ended."""

    def found() -> dict[str, Any] | None:
        answer: dict[str, Any] = client.get(f"{BASE}/diagnoses/{diagnosis_id}").json()
        return answer if answer["status"] != "running" else None

    return until(found)


def left_running(folder: Path, *, attempts: int) -> None:
    """Change a finished diagnosis into one that a killed service has left running."""
    with closing(sqlite3.connect(folder / "a.db")) as connection, connection:
        connection.execute("UPDATE diagnosis SET status = 'running', report = NULL, finished_at = NULL")
        connection.execute(
            "UPDATE job SET state = 'running', claimed_by = 'dead', renewals = 9, finished_at = NULL, attempts = ?",
            (attempts,),
        )
    with closing(open_database(f"sqlite:///{folder / 'a.db'}")) as database, database.writing() as written:
        reseal(written)


def test_what_a_dead_service_left_running_is_made_by_the_next_and_given_up_at_last(tmp_path: Path) -> None:
    """And of a clutch without a test there is nothing to adopt."""
    with service(tmp_path) as client:
        report = diagnosed(client, adopt=True)
        assert (report["verdict"], report["adopted"], report["as_of_cycles"]) == ("model_adequate", False, None)
        refused = adopt(client, report["diagnosis_id"])
        assert (refused.status_code, refused.headers["Content-Type"]) == (409, "application/problem+json")
        assert refused.json()["title"] == "There is nothing to adopt"
        assert client.get(f"{BASE}/model").json()["versions"] == []
    left_running(tmp_path, attempts=1)
    with service(tmp_path) as client:
        again = ended(client, report["diagnosis_id"])
        assert again | {"finished_at": ""} == report | {"finished_at": ""}
        assert client.get(f"/v1/jobs/{report['diagnosis_id']}").json()["attempts"] == 2
    left_running(tmp_path, attempts=MAX_ATTEMPTS)
    with service(tmp_path) as client:
        found = ended(client, report["diagnosis_id"])
        assert (found["status"], "stopped 3 times" in found["problem"]) == ("failed", True)
        assert client.get(f"/v1/jobs/{report['diagnosis_id']}").json()["state"] == "failed"


@pytest.mark.slow
def test_who_joins_a_diagnosis_that_runs_has_it_adopted(tmp_path: Path) -> None:
    with service(tmp_path, "slow") as client:
        post_tests(client, 0, 1000, 2000)
        first, joined = asked(client), asked(client, 120, adopt=True)
        assert joined.json()["diagnosis_id"] == first.json()["diagnosis_id"]
        assert (joined.status_code, joined.json()["adopted"]) == (201, True)
        assert client.get(f"{BASE}/model").json()["version"] == 1


@pytest.mark.slow
def test_a_job_is_held_while_what_it_found_is_adopted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else another service would begin it again, and neither come to its end."""
    adopted, renewals = adopt_model.finish_and_adopt, []

    def slowly(*arguments: Any, **named: Any) -> bool:
        with closing(sqlite3.connect(tmp_path / "a.db")) as connection:

            def found() -> int:
                return connection.execute("SELECT renewals FROM job").fetchone()[0]

            begun = found()
            renewals.append(until(lambda: found() > begun + 2))
        return adopted(*arguments, **named)

    monkeypatch.setattr(adopt_model, "finish_and_adopt", slowly)
    with service(tmp_path, job_lease_seconds=2) as client:
        post_tests(client, 0, 1000, 2000)
        assert diagnosed(client, adopt=True)["adopted"]
    assert renewals


def test_a_job_is_shown_and_cancelled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The one that runs is ended with its process, the one that waits is not begun; both are failed diagnoses."""
    monkeypatch.setenv("STAND_IN_PID", str(tmp_path / "pid"))
    with service(tmp_path, "endless", job_lease_seconds=1) as client:
        ids = []
        for cycles in (0, 1000):
            post_tests(client, cycles)
            ids.append(asked(client).json()["diagnosis_id"])
        until(lambda: client.get(f"/v1/jobs/{ids[0]}").json()["progress"] == {"step": "diagnoses"})
        until((tmp_path / "pid").exists)
        process = int((tmp_path / "pid").read_text())
        listed = client.get("/v1/jobs").json()
        JobPage.model_validate(listed)
        shown = [(each["job_id"], each["state"]) for each in listed["items"]]
        assert shown == [(ids[1], "waiting"), (ids[0], "running")]
        assert [each["job_id"] for each in client.get("/v1/jobs?state=waiting").json()["items"]] == [ids[1]]
        page = client.get("/v1/jobs?limit=1").json()
        assert client.get("/v1/jobs", params={"cursor": page["next"]}).json()["items"] == listed["items"][1:]
        for job_id in (ids[1], ids[0]):
            cancelled = client.delete(f"/v1/jobs/{job_id}")
            assert (cancelled.status_code, cancelled.json()["state"]) == (200, "cancelled")
            assert cancelled.json()["problem"] == "cancelled by local"
            found = ended(client, job_id)
            assert (found["status"], found["problem"]) == ("failed", "cancelled by local")
        until(lambda: not Path(f"/proc/{process}").exists())
        assert client.delete(f"/v1/jobs/{ids[0]}").json() == client.get(f"/v1/jobs/{ids[0]}").json()
        for method in ("GET", "DELETE"):
            assert client.request(method, "/v1/jobs/nothing").status_code == 404
