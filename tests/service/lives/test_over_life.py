"""Measured engagements over the wire: receipts, what is said of records without one, indicators over a life, the model's."""

import csv
import io
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.lives.engagements import ALL_INDICATORS
from service.workflows.replay import replay_clutch
from storage.engine.opening import open_database
from tests.models.engagements.closed_forms import Engagement, constant, record
from tests.support import stationary

CLUTCH = "/v1/clutches/c1"
RUNS = f"{CLUTCH}/runs"
COF = 0.05


def engaged(cycles: float, form: Engagement, **changed: Any) -> dict[str, Any]:
    """A block of duty that carries one engagement, 50 samples a second."""
    taken = record(form, 50.0, int(cycles))
    channels = {
        "time_s": taken.time.tolist(),
        "pressure_bar": (taken.pressure / 1e5).tolist(),
        "speed_rpm": (taken.speed * 30 / np.pi).tolist(),
        "torque_nm": taken.torque.tolist(),
    }
    duty = {"cycles": 500, "initial_speed_rpm": 2000, "maximum_pressure_bar": 8}
    return {
        "kind": "duty_cycles",
        "cycles": cycles,
        "run_id": f"duty-{cycles:g}",
        "duty": duty,
        "channels": channels | changed,
    }


def sent(client: TestClient, body: dict[str, Any]) -> dict[str, Any]:
    answer = client.post(RUNS, json=body)
    assert answer.status_code == 201, answer.text
    receipt: dict[str, Any] = answer.json()
    assert receipt["state"] == "accepted", receipt["doubts"]
    return receipt


def test_a_receipt_holds_the_engagement_in_public_units(client: TestClient) -> None:
    form = constant(COF)
    receipt = sent(client, engaged(500, form))
    engagement, expected = receipt["engagement"], form.expected()
    assert engagement["status"] == "determined"
    assert receipt["warnings"] == []
    assert engagement["initial_speed_rpm"] == pytest.approx(2000, rel=0.01)
    assert engagement["maximum_pressure_bar"] == pytest.approx(8, rel=0.03)
    assert engagement["end_s"] - engagement["start_s"] == pytest.approx(expected["stop_time"], rel=0.01)
    found = engagement["indicators"]
    assert found["stop_time_s"]["value"] == pytest.approx(expected["stop_time"], rel=0.01)
    assert found["engagement_energy_kj"]["value"] == pytest.approx(expected["energy"] / 1000, rel=0.01)
    assert found["peak_power_kw"]["value"] == pytest.approx(expected["peak_power"] / 1000, rel=0.02)
    assert found["midpoint_cof"]["value"] == pytest.approx(COF, rel=0.01)
    assert found["breakaway_cof"] is None
    assert all(estimate["sd"] > 0 for estimate in found.values() if estimate is not None)
    assert sent(client, {"kind": "duty_cycles", "cycles": 700, "duty": {"cycles": 200}})["engagement"] is None


def test_a_block_whose_engagement_cannot_be_evaluated_is_stored_and_says_why(client: TestClient) -> None:
    speed = engaged(500, constant(COF))["channels"]["speed_rpm"]
    receipt = sent(client, engaged(500, constant(COF), speed_rpm=[value + 100 for value in speed]))
    assert receipt["engagement"]["status"] == "slip_never_ends"
    assert set(receipt["engagement"]["indicators"].values()) == {None}
    (warning,) = receipt["warnings"]
    assert warning["code"] == "no_engagement"
    assert "slip must end" in warning["message"]
    assert client.get(f"{RUNS}/duty-500").json()["samples"] == len(speed)
    flat = engaged(600, constant(COF))
    flat["channels"]["torque_nm"] = [0.0] * len(flat["channels"]["time_s"])
    held = client.post(RUNS, json=flat).json()
    assert (held["state"], held["doubts"][0]["code"]) == ("held", "dead_channel")
    assert held["engagement"]["status"] == "no_torque"
    assert client.get(f"{CLUTCH}/series", params={"quantity": "stop_time_s"}).json()["items"] == []


def test_indicators_are_followed_over_the_cycles_of_a_life(client: TestClient) -> None:
    """Three engagements make the reference; a longer one differs; one of another duty is not compared, one that is withdrawn
    is not listed, and a rebuild begins again."""
    for cycles in (500, 1000, 1500):
        sent(client, engaged(cycles, constant(COF)))
    sent(client, engaged(2000, constant(COF / 1.2)))
    slow = engaged(2500, constant(COF))
    slow["channels"]["speed_rpm"] = [0.6 * value for value in slow["channels"]["speed_rpm"]]
    slow["duty"]["initial_speed_rpm"] = 1200
    sent(client, slow)
    sent(client, engaged(3000, constant(COF)))
    assert client.post(f"{RUNS}/duty-3000/withdraw", json={"reason": "another clutch"}).status_code == 200
    rows = client.get(f"{CLUTCH}/series", params={"quantity": "normalised_duration"}).json()["items"]
    assert [row["cycles"] for row in rows] == [500, 1000, 1500, 2000]
    assert [row["value"] for row in rows] == pytest.approx([1, 1, 1, 1.2], rel=0.01)
    assert all(row["lower"] < row["value"] < row["upper"] for row in rows)
    sheet = csv.DictReader(io.StringIO(client.get(f"{CLUTCH}/series.csv").text))
    listed = {row["quantity"] for row in sheet}
    assert set(ALL_INDICATORS) - listed == {"breakaway_cof", "breakaway_cof_ratio"}
    sent(client, {"kind": "maintenance", "cycles": 3200, "event": "rebuild"})
    sent(client, engaged(3700, constant(COF / 1.2)))
    again = client.get(f"{CLUTCH}/series", params={"quantity": "normalised_duration"}).json()["items"][-1]
    assert (again["cycles"], again["value"]) == (3700, pytest.approx(1.0))


def test_a_replay_changes_no_indicator(client: TestClient, database_url: str) -> None:
    for cycles in (500, 1000):
        sent(client, engaged(cycles, constant(COF)))
    before = client.get(RUNS).json()["items"]
    with closing(open_database(database_url)) as database:
        replay_clutch(database, "c1")
    assert client.get(RUNS).json()["items"] == before


def test_the_tracked_model_stands_beside_a_measured_engagement(client: TestClient) -> None:
    for cycles in (0, 1000, 2000):
        sent(client, stationary(cycles, pressures=(5.0,)))
    sent(client, engaged(500, constant(COF)))
    sent(client, engaged(1500, constant(COF)))
    answer = client.get(f"{CLUTCH}/engagement").json()
    assert [row["run_id"] for row in answer["measured"]] == ["duty-500", "duty-1500"]
    compared = answer["compared"]
    assert compared["run_id"] == "duty-1500"
    for channels in (compared["channels"], compared["model"]["channels"]):
        assert len({len(column) for column in channels.values()}) == 1
    assert compared["model"]["inertia_kg_m2"] == pytest.approx(0.6, rel=0.03)
    assert 0 < compared["model"]["torque_discrepancy"] < 1
    assert client.get(f"{CLUTCH}/engagement", params={"run_id": "stationary"}).status_code == 404
    first = client.get(f"{CLUTCH}/engagement", params={"run_id": "duty-500"}).json()
    assert first["compared"]["run_id"] == "duty-500"
    assert first["duration_s"] == answer["duration_s"]
    remaining = client.get(f"{CLUTCH}/remaining-useful-life", params={"quantity": "stop_time_s"})
    assert remaining.status_code == 200, remaining.text
    assert [item["quantity"] for item in remaining.json()["criteria"]] == ["stop_time_s"]
