"""Tests that no track follows: with the clutch open, evidence for the diagnosis alone, and in much colder oil."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.api.life import ModelName
from service.clutch.assumptions import Assumptions, ModelInForce
from service.clutch.model_correction import corrected_cofs
from service.clutch.timeline import Event, Life
from storage.engine.opening import open_database
from tests.lab.plausibility.bench import with_gain
from tests.service.changes.benches import without_revision
from tests.service.clients import client_of, post_run
from tests.service.clutch.diagnosis.test_campaign import campaign, idle_record, post
from tests.service.jobs.replaying import replay_clutch
from tests.service.runs.test_upload import dynamic_record
from tests.support import stationary

CLUTCH = "/v1/clutches/c1"
RUNS = f"{CLUTCH}/runs"
SPEEDS = [20.0, 520.0, 1020.0, 1520.0, 1970.0]
#: What is said of a clutch, and what of it has a CSV twin; questions to which no open test changes an answer.
TWINS = ("degradation", "stribeck", "loops", "series", "surfaces", "scores")
TOLD = ("remaining-useful-life", "engagement", *TWINS)
QUESTIONS = (
    *TOLD,
    *(f"{name}.csv" for name in TWINS),
    "engagement?at_cycles=1000",
    *(f"remaining-useful-life?{each}" for each in ("method=ukf", "method=grid", "pressure_bar=5", "at_cycles=2500")),
)


def sweep(cycles: float, run_id: str, **changed: Any) -> dict[str, Any]:
    """The advised stationary test: no pressure, the speeds five times over."""
    speed = SPEEDS * 5
    torque = [0.1 + 4e-4 * n + 0.01 * (i % 3) for i, n in enumerate(speed)]
    channels = {"pressure_bar": [0.0, 0.02, 0.0, 0.01, 0.0] * 5, "speed_rpm": speed, "torque_nm": torque}
    return {"kind": "stationary_stribeck", "cycles": cycles, "run_id": run_id, "channels": channels | changed}


def raw_sweep(noise: float) -> dict[str, list[float]]:
    """The same as its recorder saw it, 50 samples a second, a plateau 4 s."""
    rng, per = np.random.default_rng(5), 200
    speed = np.repeat(SPEEDS, per)
    return {
        "time_s": (np.arange(speed.size) / 50).tolist(),
        "pressure_bar": (noise * rng.standard_normal(speed.size)).tolist(),
        "speed_rpm": (speed + rng.standard_normal(speed.size)).tolist(),
        "torque_nm": (0.1 + 4e-4 * speed + 0.02 * rng.standard_normal(speed.size)).tolist(),
    }


def idle_loops(cycles: float) -> dict[str, Any]:
    """The advised dynamic test."""
    return {"kind": "dynamic_stribeck", "cycles": cycles, "run_id": f"idle-{cycles:g}", "channels": idle_record()}


def told(client: TestClient) -> dict[str, Any]:
    """All that is said of a clutch beside the list of its runs."""
    said: dict[str, Any] = {}
    for question in QUESTIONS:
        answer = client.get(f"{CLUTCH}/{question}")
        assert answer.status_code == 200
        said[question] = without_revision(answer.text if ".csv" in question else answer.json())
    summary = client.get("/v1/clutches").json()["items"][0]
    said["line"] = summary["recent"]["mean_cof"]
    return said | {"summary": {n: v for n, v in summary.items() if n not in ("runs", "recent", "revision")}}


def life() -> list[dict[str, Any]]:
    return [stationary(at, run_id=f"s{at}") for at in (0, 1000, 2000, 3000)]


def test_an_open_sweep_is_taken_in_and_said_to_be_one(client: TestClient, database_url: str) -> None:
    receipt = post_run(client, sweep(0, "open"))
    assert (receipt["fits"], receipt["loops"]) == ([], [])
    assert [each["code"] for each in receipt["warnings"]] == ["open_clutch"]
    assert "(all pressures below 0.05 bar): no curve is fitted" in receipt["warnings"][0]["message"]
    assert client.post(RUNS, json=sweep(0, "open")).json() == receipt | {"duplicate": True}
    assert client.get(f"{RUNS}/open").json()["channels"] == sweep(0, "open")["channels"]
    (run,) = campaign(database_url).campaign.stationary
    assert run.plateaus.torque.size == 25
    post(client, stationary(0, run_id="s0"))
    known = campaign(database_url)
    shifted = SimpleNamespace(
        weights=np.ones(1), artefact=lambda run, _: np.ones((1, run.plateaus.torque.size)), law=None
    )
    found = corrected_cofs(shifted, known.record, known.life, known.runs, known.campaign.stationary)  # type: ignore[arg-type]
    assert found.keys() == {"s0"}  # an adopted model corrects no open test
    one = {"pressure_bar": [0.0], "speed_rpm": [500.0], "torque_nm": [-0.1], "torque_sd_nm": [0.01]}
    post_run(client, sweep(0, "one", **one))


@pytest.mark.parametrize("noise", [0.0, 0.01], ids=["exact", "noisy"])
def test_so_is_its_raw_record(client: TestClient, database_url: str, noise: float) -> None:
    post(client, {"kind": "stationary_stribeck", "cycles": 0, "run_id": "raw", "channels": raw_sweep(noise)})
    receipt = client.get(f"{RUNS}/raw").json()
    assert receipt["fits"] == []
    assert "open_clutch" in [each["code"] for each in receipt["warnings"]]
    (run,) = campaign(database_url).campaign.stationary
    assert run.plateaus.speed * 30 / np.pi == pytest.approx(SPEEDS, abs=1)
    assert run.plateaus.torque == pytest.approx(0.1 + 4e-4 * np.array(SPEEDS), abs=0.01)
    assert run.record is not None


@pytest.mark.slow
def test_while_there_is_nothing_else_all_is_answered_as_without_tests(client: TestClient) -> None:
    bare = {name: client.get(f"{CLUTCH}/{name}").status_code for name in QUESTIONS}
    post(client, sweep(500, "open"), idle_loops(500))
    assert {name: client.get(f"{CLUTCH}/{name}").status_code for name in QUESTIONS} == bare
    said = client.get(f"{CLUTCH}/remaining-useful-life").json()
    assert (said["status"], said["runs_used"], said["as_of_cycles"]) == ("insufficient_data", 0, 500)
    assert said["criterion"]["initial_mean_cof"] is None
    for name in ("degradation", "stribeck"):
        assert client.get(f"{CLUTCH}/{name}").json()["items"] == []
    assert client.get(f"{RUNS}").json()["items"][1]["run_id"] == "open"
    assert client.get("/v1/clutches").json()["items"][0]["summary"]["status"] == "insufficient_data"
    # many plateaus whose pressures are a sensor's noise are no curve to the diagnosis either
    more = [sweep(500, f"noise-{at}", pressure_bar=[0.001 * (at + i % 7) for i in range(25)]) for at in range(4)]
    post(client, *more)
    answer = client.post(f"{CLUTCH}/diagnoses", json={}, headers={"Prefer": "wait=120"}).json()
    assert (answer["status"], answer["verdict"]) == ("finished", "insufficient_data")


@pytest.mark.slow
def test_no_track_sees_an_open_test_at_a_state(client: TestClient, database_url: str) -> None:
    """Not to the last bit, whether it comes last or late, nor after all was made again."""
    post(client, *life())
    before = told(client)
    assert before["remaining-useful-life"]["runs_used"] == 4  # there is something that a fifth state would change
    assert before["remaining-useful-life"]["status"] != "insufficient_data"
    post(client, sweep(3000, "last"), sweep(1000, "late"), sweep(0, "first") | {"started_at": "2020-01-01T00:00:00Z"})
    assert told(client) == before
    raw = {"kind": "stationary_stribeck", "cycles": 2000, "run_id": "raw", "channels": raw_sweep(0.01)}
    post(client, raw)
    assert told(client) == before
    etag = client.get(CLUTCH).headers["etag"]
    with closing(open_database(database_url)) as database:
        assert replay_clutch(database, "c1") == 8
    assert told(client) == before
    assert client.get(CLUTCH).headers["etag"] == etag
    # one that came first leaves the reference to the first with load
    assert client.post("/v1/clutches", json={"clutch_id": "c2"}).status_code == 201
    for body in (sweep(0, "open") | {"started_at": "2020-01-01T00:00:00Z"}, *life()):
        post_run(client, body, "c2")
    for name in ("stribeck", "stribeck.csv"):
        assert client.get(f"/v1/clutches/c2/{name}").text == client.get(f"{CLUTCH}/{name}").text
    tracks, earlier = client.get("/v1/clutches/c2/degradation").json()["items"], before["degradation"]["items"]
    assert [each["measured"] for each in tracks] == [each["measured"] for each in earlier]
    assert client.get("/v1/clutches/c2/remaining-useful-life?pressure_bar=5").json()["runs_used"] == 4


def test_curves_are_paged_past_open_tests(client: TestClient) -> None:
    post(client, sweep(0, "a"), stationary(0, run_id="b"), sweep(0, "c"), sweep(500, "d"), stationary(1000, run_id="e"))
    first = client.get(f"{CLUTCH}/stribeck?limit=1").json()
    assert [each["run_id"] for each in first["items"]] == ["b"]
    second = client.get(f"{CLUTCH}/stribeck?limit=1&cursor={first['next']}").json()
    assert ([each["run_id"] for each in second["items"]], second["next"]) == (["e"], None)


def test_loops_are_told_against_the_state_s_test_with_load(client: TestClient) -> None:
    loops = {"kind": "dynamic_stribeck", "cycles": 500, "run_id": "d", "channels": dynamic_record()}
    post(client, stationary(0, run_id="s0"), loops)
    before = client.get(f"{CLUTCH}/loops").json()
    post(client, sweep(400, "open"))
    assert client.get(f"{CLUTCH}/loops").json() == before
    assert before["items"][0]["attractor_nm_s"] is not None


# --- A test whose oil is much colder than the first test's is said so, and no track follows it, whenever it arrives.


def in_oil(cycles: float, oil_c: float | None, gain: float = 1.0) -> dict[str, Any]:
    """A stationary test with its oil at some temperature, and torque so many times what it would be."""
    run = with_gain(stationary(cycles, run_id=f"at-{cycles:g}", pressures=(5.0, 6.0)), gain)
    if oil_c is not None:
        run["channels"]["oil_temperature_c"] = [oil_c] * len(run["channels"]["torque_nm"])
    return run


def codes(client: TestClient, run_id: str) -> list[str]:
    return [warning["code"] for warning in client.get(f"{CLUTCH}/runs/{run_id}").json()["warnings"]]


def remaining(client: TestClient) -> dict[str, Any]:
    return client.get(f"{CLUTCH}/remaining-useful-life", params={"method": "grid"}).json()


USUAL = [in_oil(1000.0 * place, 80.0 + 2.5 * place) for place in range(4)]
COLD = in_oil(2500.0, 40.0, gain=1.08)


def test_a_test_in_cold_oil_is_said_so_and_not_tracked(client: TestClient) -> None:
    """What keeps it out is its oil: tests in usual oil count, and so does one without a measured temperature."""
    for run in USUAL:
        assert post_run(client, run)["warnings"] == []
    before = remaining(client)
    receipt = post_run(client, COLD)
    warned = {warning["code"]: warning["message"] for warning in receipt["warnings"]}
    assert receipt["state"] == "accepted"
    assert warned.keys() == {"late_arrival", "other_oil_temperature"}
    assert "was 40 °C in this test" in warned["other_oil_temperature"]
    assert "80 °C" in warned["other_oil_temperature"]
    after = remaining(client)
    assert after["runs_used"] == 4
    for part in ("current", "end_of_life_cycles"):
        assert after[part] == before[part]
    parameters = client.get(f"{CLUTCH}/degradation").json()["items"]
    assert {len(item["measured"]["cycles"]) for item in parameters} == {4}
    for run in (in_oil(4000.0, 90.0), in_oil(5000.0, None)):
        assert "other_oil_temperature" not in [warning["code"] for warning in post_run(client, run)["warnings"]]
    assert remaining(client)["runs_used"] == 6


def test_whatever_the_order_the_first_test_by_cycles_is_the_reference(client: TestClient, tmp_path: Path) -> None:
    """The cold test comes first and is the reference until those before it by cycles arrive."""
    for run in (COLD, *reversed(USUAL)):
        post_run(client, run)
    names = [run["run_id"] for run in (*USUAL, COLD)]
    assert [name for name in names if "other_oil_temperature" in codes(client, name)] == [COLD["run_id"]]
    answers = [remaining(client)]
    with client_of(tmp_path / "in_order.db") as other:
        for run in sorted((*USUAL, COLD), key=lambda run: float(run["cycles"])):
            post_run(other, run)
        answers.append(remaining(other))
    assert answers[0]["end_of_life_cycles"] == answers[1]["end_of_life_cycles"]
    assert [answer["runs_used"] for answer in answers] == [4, 4]


@pytest.mark.parametrize(
    ("effects", "measured"), [([], 1), (["torque_zero_shift"], 1), (["interface_heating", "oil_temperature"], 2)]
)
def test_a_model_that_corrects_for_the_oil_has_its_mean_cof_tracked(effects: list[str], measured: int) -> None:
    level = {5e5: (0.1, 0.001)}
    at_first = {"cycles": 0.0, "moment": 0.0, "oil_temperature": 358.0}
    warm = Event(run_id="warm", kind="stationary_stribeck", cofs=level, **at_first)
    cold = replace(warm, run_id="cold", cycles=1000.0, oil_temperature=313.0)
    tested_life = Life(origin=0.0, events=(warm, cold))
    under = Assumptions(model=ModelInForce(name=ModelName(name="extended", effects=effects)))
    assert len(tested_life.pooled(under).measurements) == measured
    # Stribeck parameters are those of the baseline's fits: nothing corrects them
    parameter = tested_life.series(under, "static_torque_nm", 5e5, [(20.0, 0.1), (22.0, 0.1)])
    assert len(parameter.measurements) == 1
