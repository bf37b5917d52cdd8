"""Runs come in any order, and some fit no life: the answers are the same, and say so."""

from pathlib import Path

import httpx2
import numpy as np
import pytest

from tests.support import PRESSURES_BAR, SPEEDS_RPM, post_tests, serving, stationary

BASE = "/v1/clutches/c1"


def without_revision(http: httpx2.Client, **params: str | float) -> dict[str, object]:
    prediction: dict[str, object] = http.get(f"{BASE}/remaining-useful-life", params=params).json()
    return prediction | {"revision": 0}


@pytest.mark.slow
def test_the_order_of_arrival_does_not_matter(tmp_path: Path) -> None:
    # the first test's speeds and pressures set what all means are over; the others' differ, and one lacks a pressure
    ranges = {0: SPEEDS_RPM, 500: SPEEDS_RPM[:30], 1000: SPEEDS_RPM[5:], 2000: SPEEDS_RPM, 3000: SPEEDS_RPM[:20]}
    bodies = [stationary(cycles, run_id=f"s{cycles}", speeds=speeds) for cycles, speeds in ranges.items()]
    bodies.append(stationary(4000, run_id="s4000", pressures=PRESSURES_BAR[1:]))
    bodies += [
        {"kind": "duty_cycles", "cycles": cycles, "duty": {"cycles": 1000}, "run_id": f"d{cycles}"}
        for cycles in (1000, 2000, 5000)
    ]
    answers = []
    for seed in (None, 1, 2):
        order = np.arange(len(bodies)) if seed is None else np.random.default_rng(seed).permutation(len(bodies))
        with serving(tmp_path / f"{seed}.db", loaded=True) as server:
            http = server.http
            http.post("/v1/clutches", json={"clutch_id": "c1"})
            for index in order:
                assert http.post(f"{BASE}/runs", json=bodies[index]).status_code == 201
            answers.append(
                [
                    *(without_revision(http, method=method) for method in ("particle", "ukf", "grid")),
                    without_revision(http, at_cycles=2500.0),
                    without_revision(http, pressure_bar=6.0),
                    without_revision(http, method="grid", at_cycles=3000),
                    http.get(f"{BASE}/degradation").json()["items"],
                    http.get(f"{BASE}/stribeck").json(),
                    [item["fits"] for item in http.get(f"{BASE}/runs").json()["items"]],
                    [row | {"time": None} for row in http.get(f"{BASE}/series").json()["items"]],
                ]
            )
    assert answers[0] == answers[1] == answers[2]


def test_at_equal_cycles_the_earlier_start_comes_first(http: httpx2.Client) -> None:
    """A test at the same cycles that was made earlier becomes the reference, though it arrives later."""
    first = stationary(0, run_id="b") | {"started_at": "2026-01-02T00:00:00+00:00"}
    earlier = stationary(0, run_id="a", speeds=SPEEDS_RPM[:15]) | {"started_at": "2026-01-01T00:00:00+00:00"}
    for name, bodies in (("c1", (first, earlier)), ("c2", (earlier, first))):
        http.post("/v1/clutches", json={"clutch_id": name})
        for body in (*bodies, stationary(1000, run_id="c"), stationary(2000, run_id="d")):
            assert http.post(f"/v1/clutches/{name}/runs", json=body).status_code == 201
    pages = [http.get(f"/v1/clutches/{name}/runs").json()["items"] for name in ("c1", "c2")]
    by_name = [{item["run_id"]: item["fits"] for item in items} for items in pages]
    assert by_name[0] == by_name[1]


def test_what_was_done_before_a_rebuild_at_its_cycles_is_taken(http: httpx2.Client) -> None:
    http.post("/v1/clutches", json={"clutch_id": "c1"})
    bodies = [
        stationary(0) | {"started_at": "2026-01-01T00:00:00Z"},
        {"kind": "maintenance", "event": "rebuild", "cycles": 1000, "started_at": "2026-02-01T00:00:00Z"},
        {"kind": "duty_cycles", "duty": {"cycles": 1000}, "cycles": 1000, "started_at": "2026-01-15T00:00:00Z"},
        {"kind": "maintenance", "event": "rest", "cycles": 1000, "started_at": "2026-01-16T00:00:00Z"},
    ]
    assert [http.post(f"{BASE}/runs", json=body).status_code for body in bodies] == [201] * 4


def test_a_first_test_without_a_mean_cof_sets_no_reference(http: httpx2.Client) -> None:
    mad = stationary(0, pressures=(5.0,), speeds=(0.0, 1.0, 2.0, 3.0, 4.0, 1e6))
    mad["channels"]["torque_nm"] = [-20.0] * 6
    predictions = {}
    for name in ("with", "without"):
        http.post("/v1/clutches", json={"clutch_id": name})
        if name == "with":
            warnings = http.post(f"/v1/clutches/{name}/runs", json=mad).json()["warnings"]
            assert "no_mean_cof" in {warning["code"] for warning in warnings}
        post_tests(http, 10, 1000, 2000, 3000, to=name)
        predictions[name] = http.get(f"/v1/clutches/{name}/remaining-useful-life?method=grid").json()
    for part, key in (("current", "mean_cof"), ("criterion", "initial_mean_cof")):
        assert predictions["with"][part][key] == pytest.approx(predictions["without"][part][key], rel=1e-2)


def test_a_test_at_other_pressures_says_that_no_track_uses_it(http: httpx2.Client) -> None:
    http.post("/v1/clutches", json={"clutch_id": "c1"})
    http.post(f"{BASE}/runs", json=stationary(0, pressures=(4.0, 5.0)))
    answer = http.post(f"{BASE}/runs", json=stationary(1000, pressures=(6.0, 7.0))).json()
    assert [warning["code"] for warning in answer["warnings"]] == ["other_pressures"]
    assert http.get(f"{BASE}/remaining-useful-life").json()["runs_used"] == 1


def test_a_missing_pressure_does_not_shift_the_mean(http: httpx2.Client) -> None:
    """COF differs between pressures, so the mean over those left would jump; the rest is scaled as in the reference.

    What is left is that the pressures do not wear quite alike.
    """
    for name, pressures in (("all", PRESSURES_BAR), ("fewer", PRESSURES_BAR[2:])):
        http.post("/v1/clutches", json={"clutch_id": name})
        for cycles in (0, 1000, 2000):
            body = stationary(cycles, noise=0.0, pressures=PRESSURES_BAR if cycles < 2000 else pressures)
            receipt = http.post(f"/v1/clutches/{name}/runs", json=body).json()
    plain = sum(fit["mean_cof"] for fit in receipt["fits"]) / len(receipt["fits"])
    full, scaled = (
        http.get(f"/v1/clutches/{name}/degradation").json()["items"][0]["measured"]["value"][-1]
        for name in ("all", "fewer")
    )
    assert abs(scaled - full) < 0.01 * full
    assert abs(plain - full) > 3 * abs(scaled - full)


def test_a_rebuild_starts_a_new_life(http: httpx2.Client) -> None:
    http.post("/v1/clutches", json={"clutch_id": "c1"})
    post_tests(http, 0, 1000, 2000, 3000)
    worn = without_revision(http)
    http.post(f"{BASE}/runs", json={"kind": "maintenance", "cycles": 3000, "event": "rebuild"})
    assert without_revision(http)["status"] == "insufficient_data"
    for cycles in (3000, 4000, 5000, 6000):
        body = stationary(cycles - 3000, run_id=f"after-{cycles}")
        assert http.post(f"{BASE}/runs", json=body | {"cycles": cycles}).status_code == 201
    rebuilt = without_revision(http)
    assert rebuilt["as_of_cycles"] == 6000
    assert rebuilt["runs_used"] == 4
    for quantile in ("0.25", "0.5"):
        old, new = worn["end_of_life_cycles"], rebuilt["end_of_life_cycles"]
        assert isinstance(old, dict)
        assert isinstance(new, dict)
        assert new[quantile] == pytest.approx(old[quantile] + 3000, rel=0.1)
