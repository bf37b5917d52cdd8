"""Scores of lives that came to their end, against what is known of a made-up clutch."""

import math

import pytest
from fastapi.testclient import TestClient

from tests.service.changes.test_learn_fleet import SPEEDS
from tests.support import post_tests, torque_nm

BASE = "/v1/clutches/c1"


def mean_torque(wear: float) -> float:
    speeds = [20.0 + 50 * i for i in range(40)]
    low, high = min(SPEEDS), max(SPEEDS)
    inside = [low + (high - low) * i / (len(speeds) - 1) for i in range(len(speeds))]
    return math.fsum(torque_nm(5.0, n, wear) for n in inside) / len(inside)


def post_life(client: TestClient, last: int = 22_000) -> None:
    post_tests(client, *range(0, last + 1, 1000), speeds=SPEEDS, pressures=(5.0,), noise=0.004)


def test_a_life_that_has_not_ended_has_no_scores(client: TestClient) -> None:
    post_life(client, last=4000)
    assert client.get(f"{BASE}/scores").json()["items"] == []
    assert client.get(f"{BASE}/scores.csv").status_code == 200
    assert client.get("/v1/fleet/scores").json()["overall"]["crps_share"] is None
    assert client.get("/v1/clutches/nobody/scores").status_code == 404


@pytest.mark.slow
def test_a_life_that_ended_is_scored(client: TestClient) -> None:
    post_life(client)
    wear = [0.9 * (1 - (1 + cycles / 6000) ** -0.9) for cycles in range(22_001)]
    fresh = mean_torque(0.0)
    true_end = next(cycles for cycles, w in enumerate(wear) if mean_torque(w) < 0.5 * fresh)
    item = client.get(f"{BASE}/scores").json()["items"][0]
    assert item["end_of_life_cycles"] == pytest.approx(true_end, rel=0.02)
    tests = item["predictions"]
    end = item["end_of_life_cycles"]
    assert [test["cycles"] for test in tests] == [cycles for cycles in range(2000, 22_001, 1000) if cycles < end]
    for test in tests:
        assert test["true_remaining_cycles"] == pytest.approx(end - test["cycles"])
        then = client.get(f"{BASE}/remaining-useful-life", params={"at_cycles": test["cycles"]}).json()
        assert then["remaining_cycles"] == test["remaining_cycles"]
        low, high = (then["end_of_life_cycles"][q] for q in ("0.05", "0.95"))
        assert test["covered"] is (low <= end and (high is None or end <= high))
        assert 0 < test["pit"] < 1
    assert tests[-1]["crps_share"] < 0.02 < tests[0]["crps_share"]
    assert tests[-1]["crps_cycles"] == pytest.approx(tests[-1]["crps_share"] * item["end_of_life_cycles"])
    assert item["summary"]["coverage"] == pytest.approx(sum(t["covered"] for t in tests) / len(tests))
    assert math.fsum(item["pit_histogram"]) == pytest.approx(1.0)
    fleet = client.get("/v1/fleet/scores").json()
    assert fleet["overall"] == item["summary"]
    assert [stage["share_of_life"] for stage in fleet["stages"]] == [0.2, 0.4, 0.6, 0.8]
    assert fleet["lives"][0]["clutch_id"] == "c1"
    assert len(client.get(f"{BASE}/scores.csv").text.splitlines()) == 1 + len(tests)
    assert len(client.get("/v1/fleet/scores.csv").text.splitlines()) == 6
    by_grid = client.get(f"{BASE}/scores", params={"method": "grid"}).json()["items"][0]
    assert by_grid["summary"]["predictions"] == len(tests)
