"""Remaining life under planned duty, over HTTP: as severe as recent duty, twice as severe, uncertain, by date."""

from collections.abc import Iterator
from datetime import datetime
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.clutch.plausibility.doubts import Judged
from tests.service.clients import filled_client, post_run
from tests.support import post_tests, stationary

FORECAST = "/v1/clutches/{}/remaining-useful-life/forecast"
FEW: dict[str, Any] = {"pressures": (5.0,), "speeds": (20, 120, 520, 1020, 1970)}
QUANTILES = ("0.05", "0.5", "0.95")


@pytest.fixture(scope="module", autouse=True)
def _nothing_is_doubted() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("service.changes.ingest_run.doubts_together", lambda *_, **__: Judged())
        yield


def live(client: TestClient, clutch: str, tests: int, **record: Any) -> None:
    """A clutch that is tested every 1,000 cycles, a day apart, and does 20 kJ a cycle between."""
    assert client.post("/v1/clutches", json={"clutch_id": clutch} | record).status_code == 201
    for place in range(tests):
        if place:
            duty = {"cycles": 1000, "energy_per_cycle_kj": 20}
            post_run(client, {"kind": "duty_cycles", "cycles": 1000.0 * place, "duty": duty}, clutch)
        test = stationary(1000.0 * place, **FEW)
        post_run(client, test | {"started_at": f"2026-03-0{1 + place}T08:00:00+00:00"}, clutch)


@filled_client(scope="module")
def aged(client: TestClient) -> None:
    """A clutch whose severity is its energy; nobody adds to it."""
    live(client, "aged", 8, severity={"basis": "dissipated_energy", "exponent": 1.0})


def planned(client: TestClient, *blocks: dict[str, float], clutch: str = "aged", **more: Any) -> dict[str, Any]:
    method = more.pop("method", "particle")
    answer = client.post(FORECAST.format(clutch), params={"method": method}, json={"programme": blocks} | more)
    assert answer.status_code == 200, answer.text
    return answer.json()


@pytest.mark.parametrize("method", ["particle", "ukf", "grid"])
def test_duty_as_before_leaves_what_is_predicted(aged: TestClient, method: str) -> None:
    usual = aged.get("/v1/clutches/aged/remaining-useful-life", params={"method": method}).json()
    same = planned(aged, {"cycles": 500, "energy_per_cycle_kj": 20}, method=method)
    assert same["recent_duty_cycles"] == usual["remaining_cycles"]
    assert same["block_severity"] == [pytest.approx(1.0)]
    for quantile in QUANTILES:
        assert same["remaining_cycles"][quantile] == pytest.approx(usual["remaining_cycles"][quantile], rel=1e-6)
        assert same["remaining_blocks"][quantile] == pytest.approx(same["remaining_cycles"][quantile] / 500)
    assert same["status"] == usual["status"] == "predicted"


def test_twice_the_energy_halves_the_cycles_blocks_take_turns_and_nothing_is_stored(aged: TestClient) -> None:
    tag = aged.get("/v1/clutches/aged/remaining-useful-life").headers["ETag"]
    harsh = planned(aged, {"cycles": 100, "energy_per_cycle_kj": 40})
    mixed = planned(aged, {"cycles": 100, "energy_per_cycle_kj": 40}, {"cycles": 100})
    assert (harsh["block_severity"], mixed["block_severity"]) == ([pytest.approx(2.0)], [pytest.approx(2.0), 1.0])
    for quantile in QUANTILES:
        recent = harsh["recent_duty_cycles"][quantile]
        near = 5e-3 if quantile == "0.95" else 1e-9  # late ends lie sparsely
        assert harsh["remaining_cycles"][quantile] == pytest.approx(recent / 2, rel=near)
        assert mixed["remaining_cycles"][quantile] == pytest.approx(recent / 1.5, abs=100)
        assert harsh["end_of_life_cycles"][quantile] == pytest.approx(7000 + recent / 2, rel=near)
    codes = [warning["code"] for warning in mixed["warnings"]]
    assert "severity_not_counted" in codes
    assert "severity_not_counted" not in [warning["code"] for warning in harsh["warnings"]]
    assert aged.get("/v1/clutches/aged/remaining-useful-life").headers["ETag"] == tag


def test_planned_energy_counts_on_a_record_that_counts_cycles_and_the_answer_says_so(aged: TestClient) -> None:
    live(aged, "plain", 5)
    harsh = {"cycles": 100, "energy_per_cycle_kj": 40}
    by_energy = planned(aged, harsh, clutch="plain")
    by_cycles = planned(aged, harsh, clutch="plain", counted_by="cycles")
    assert (by_energy["counted_by"], by_cycles["counted_by"]) == ("dissipated_energy", "cycles")
    assert (by_energy["block_severity"], by_cycles["block_severity"]) == ([pytest.approx(2.0)], [1.0])
    recent = by_energy["recent_duty_cycles"]["0.05"]
    assert by_energy["remaining_cycles"]["0.05"] == pytest.approx(recent / 2, rel=1e-3)
    assert by_cycles["remaining_cycles"]["0.05"] == pytest.approx(recent, rel=1e-3)
    said = {warning["code"]: warning["message"] for warning in by_energy["warnings"]}
    assert "20 kJ a cycle of recent duty" in said["counted_by_energy"]


def test_speed_and_pressure_are_energy(aged: TestClient) -> None:
    """μ p A r faces ω²/(2 · 200 rad/s²), the disc's 99/133 mm with two faces: 0.13 at 5 bar and 2,000 rpm are some 9 kJ."""
    cof = aged.get("/v1/clutches/aged/remaining-useful-life").json()["current"]["mean_cof"]
    torque = cof * 2 * 5e5 * 3.14159265 / 4 * (0.133**2 - 0.099**2) * 0.058
    energy = torque * (2000 * 2 * 3.14159265 / 60) ** 2 / 400
    by_speed = planned(aged, {"cycles": 10, "initial_speed_rpm": 2000, "maximum_pressure_bar": 5})
    assert by_speed["block_severity"][0] == pytest.approx(energy / 20e3, rel=0.02)


def test_dates_follow_from_a_pace(aged: TestClient) -> None:
    dated = planned(aged, {"cycles": 100, "energy_per_cycle_kj": 20}, pace_cycles_per_hour=100)
    by_runs = planned(aged, {"cycles": 100, "energy_per_cycle_kj": 20})
    assert (dated["pace_from"], by_runs["pace_from"]) == ("request", "runs")
    assert by_runs["pace_cycles_per_hour"] == pytest.approx(1000 / 24)
    newest = datetime.fromisoformat("2026-03-08T08:00:00+00:00")
    hours = (datetime.fromisoformat(dated["end_of_life_at"]["0.5"]) - newest).total_seconds() / 3600
    assert hours == pytest.approx(dated["remaining_cycles"]["0.5"] / 100, rel=1e-3)


def test_what_cannot_be_counted_is_said(client: TestClient) -> None:
    nothing = planned(client, {"cycles": 100, "energy_per_cycle_kj": 20}, clutch="c1")
    unknown = {"status": "insufficient_data", "block_severity": [None], "pace_from": None, "end_of_life_at": None}
    assert unknown.items() <= nothing.items()
    assert nothing["remaining_blocks"]["0.5"] is None
    post_tests(client, 0.0, 1000.0, 2000.0, 3000.0, pressures=(5.0,))
    counted = planned(client, {"cycles": 100, "energy_per_cycle_kj": 20}, clutch="c1")
    assert "severity_not_counted" in [warning["code"] for warning in counted["warnings"]]


def test_a_rebuilt_clutch_has_a_whole_horizon_again(client: TestClient) -> None:
    post_run(client, {"kind": "maintenance", "event": "rebuild", "cycles": 999_000})
    for cycles in range(0, 5000, 1000):
        post_run(client, stationary(float(cycles), **FEW) | {"cycles": 999_000.0 + cycles})
    usual = client.get("/v1/clutches/c1/remaining-useful-life").json()
    same = planned(client, {"cycles": 1000}, clutch="c1")
    assert same["status"] == usual["status"]
    for quantile in ("0.05", "0.5"):
        assert same["end_of_life_cycles"][quantile] == pytest.approx(usual["end_of_life_cycles"][quantile], rel=1e-3)


def test_plans_at_the_edge_of_what_is_taken_are_answered(aged: TestClient) -> None:
    for block in (
        {"cycles": 1, "energy_per_cycle_kj": 1e-6, "sd": 1e-6},
        {"cycles": 1e12, "energy_per_cycle_kj": 1e12, "sd": 1e12},
        {"cycles": 5, "initial_speed_rpm": 1e-12, "maximum_pressure_bar": 1e-12},
    ):
        for pace in (1e-12, 1e12):
            answer = planned(aged, block, pace_cycles_per_hour=pace)
            assert 0.0 <= answer["probability_of_reaching"] <= 1.0
            assert answer["block_severity"][0] > 0.0


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"programme": []}, "/programme"),
        ({"programme": [{"cycles": 0}]}, "/programme/0/cycles"),
        ({"programme": [{"cycles": 1e-310}]}, "/programme/0/cycles"),
        ({"programme": [{"cycles": 10, "energy_per_cycle_kj": 1e-200}]}, "/programme/0/energy_per_cycle_kj"),
        ({"programme": [{"cycles": 10, "energy_per_cycle_kj": 20, "sd": 100}]}, "/programme/0"),
        ({"programme": [{"cycles": 10, "sd": 2}]}, "/programme/0"),
        ({"programme": [{"cycles": 10, "maximum_pressure_bar": 5}]}, "/programme/0"),
        ({"programme": [{"cycles": 10}], "pace_cycles_per_hour": -1}, "/pace_cycles_per_hour"),
        ({"programme": [{"cycles": 10, "energy": 5}]}, "/programme/0/energy"),
        ({}, "/programme"),
    ],
)
def test_a_programme_that_is_none_is_refused(shared_client: TestClient, body: dict[str, Any], pointer: str) -> None:
    answer = shared_client.post(FORECAST.format("c1"), json=body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == pointer
