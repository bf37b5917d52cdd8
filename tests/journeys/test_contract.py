"""The public contract's examples, one after another."""

import csv
import io
from typing import Any

import httpx2
import pytest

from tests.service.clients import filled_client
from tests.support import stationary

CLUTCH = {
    "clutch_id": "bench3-017",
    "geometry": {"inner_diameter_mm": 99, "outer_diameter_mm": 133, "friction_faces": 2},
    "oil": {"kinematic_viscosity_40c_cst": 56, "kinematic_viscosity_100c_cst": 9.3},
    "end_of_life": {"cof_fraction": 0.5},
    "friction_material": "paper",
    "reaction_plate": "steel",
    "fluid": "ATF",
}
BASE = "/v1/clutches/bench3-017"
PARAMETERS = {"static_torque_nm", "coulomb_ratio", "stribeck_velocity_m_s", "viscous_coefficient"}
QUANTILES = ["0.05", "0.1", "0.25", "0.5", "0.75", "0.9", "0.95"]


def post_life(http: httpx2.Client, last: int) -> list[dict[str, Any]]:
    """The clutch and a test every thousand cycles; the receipts."""
    assert http.post("/v1/clutches", json=CLUTCH).status_code == 201
    receipts = []
    for cycles in range(0, last * 1000 + 1, 1000):
        answer = http.post(f"{BASE}/runs", json=stationary(cycles, run_id=f"stationary-{cycles}"))
        assert answer.status_code == 201, answer.text
        receipts.append(answer.json())
    return receipts


@filled_client(scope="module")
def life(client: httpx2.Client) -> None:
    """A clutch with eight tests, for what changes nothing of it."""
    post_life(client, 7)


def test_a_clutch_is_registered_once_and_nothing_is_predicted_before_its_first_run(http: httpx2.Client) -> None:
    first = http.post("/v1/clutches", json=CLUTCH)
    again = http.post("/v1/clutches", json=CLUTCH)
    assert (first.status_code, again.status_code, first.json()) == (201, 200, again.json())
    assert first.headers["location"] == BASE
    assert http.post("/v1/clutches", json={"clutch_id": "all-defaults"}).json()["oil"] == CLUTCH["oil"]
    prediction = http.get(f"{BASE}/remaining-useful-life").json()
    assert (prediction["status"], prediction["as_of_cycles"], prediction["runs_used"]) == ("insufficient_data", None, 0)
    assert list(prediction["remaining_cycles"]) == QUANTILES


def test_a_run_gets_its_receipt(http: httpx2.Client) -> None:
    (receipt,) = post_life(http, 0)
    assert receipt["clutch_id"] == "bench3-017"
    assert (receipt["kind"], receipt["cycles"], receipt["duplicate"]) == ("stationary_stribeck", 0, False)
    assert len(receipt["content_sha256"]) == 64
    assert [fit["pressure_bar"] for fit in receipt["fits"]] == [4.0, 5.0, 6.0, 7.0]
    for fit in receipt["fits"]:
        assert set(fit["parameters"]) == set(fit["standard_errors"]) == PARAMETERS
        assert fit["acceptable"] or fit["mse_percent"] >= 5
        assert 0 < fit["mean_cof_sd"] < 0.01 * fit["mean_cof"]
    assert receipt["loops"] == []
    again = http.post(f"{BASE}/runs", json=stationary(0, run_id="stationary-0"))
    assert (again.status_code, again.json()) == (200, receipt | {"duplicate": True})
    assert http.post(f"{BASE}/runs", json=stationary(5, run_id="stationary-0")).status_code == 409
    assert http.post("/v1/clutches/nobody/runs", json=stationary(0)).status_code == 404


def test_all_kinds_of_runs_are_taken(http: httpx2.Client) -> None:
    post_life(http, 0)
    duty = {"cycles": 1000, "energy_per_cycle_kj": 18.0, "initial_speed_rpm": 2000, "maximum_pressure_bar": 8}
    sampled = {
        "time_s": [0.0, 0.1, 0.2],
        "pressure_bar": [5.0, 5.0, 5.0],
        "speed_rpm": [0.0, 10.0, -0.2],
        "torque_nm": [1, 2, 3],
    }
    for body in (
        {"kind": "run_in", "cycles": 0, "duty": {"cycles": 200}},
        {"kind": "duty_cycles", "cycles": 1000, "duty": duty},
        {"kind": "duty_cycles", "cycles": 2000, "duty": duty, "channels": sampled},
        {"kind": "dynamic_stribeck", "cycles": 2000, "channels": sampled},
        {"kind": "maintenance", "cycles": 2000, "event": "oil_change", "note": "fresh ATF"},
    ):
        answer = http.post(f"{BASE}/runs", json=body)
        assert answer.status_code == 201, answer.text
        again = http.post(f"{BASE}/runs", json=body)
        assert (again.status_code, again.json()["run_id"]) == (200, answer.json()["run_id"])
    items = http.get(f"{BASE}/runs").json()["items"]
    assert [item["cycles"] for item in items] == sorted(item["cycles"] for item in items)
    assert len(items) == 6
    assert http.get(f"{BASE}/remaining-useful-life").json()["as_of_cycles"] == 2000


@pytest.mark.parametrize("method", ["particle", "ukf", "grid"])
def test_remaining_life_has_the_contracts_shape(life: httpx2.Client, method: str) -> None:
    prediction = life.get(f"{BASE}/remaining-useful-life", params={"method": method}).json()
    stated = {
        "method": method,
        "as_of_cycles": 7000,
        "runs_used": 8,
        "status": "predicted",
        "horizon_cycles": 1_000_000,
    }
    assert prediction | stated | {"model": {"name": "baseline", "effects": []}} == prediction
    criterion = prediction["criterion"]
    assert criterion | {"quantity": "mean_cof", "fraction": 0.5, "pressure_bar": None} == criterion
    assert criterion["threshold_mean_cof"] == pytest.approx(0.5 * criterion["initial_mean_cof"])
    assert list(prediction["remaining_cycles"]) == list(prediction["end_of_life_cycles"]) == QUANTILES
    values = list(prediction["remaining_cycles"].values())
    assert values == sorted(values)
    assert prediction["end_of_life_cycles"]["0.5"] == pytest.approx(7000 + prediction["remaining_cycles"]["0.5"])
    assert 0 < prediction["current"]["health"] < 1
    assert prediction["current"]["health"] == pytest.approx((prediction["current"]["fraction_of_initial"] - 0.5) / 0.5)
    at_five_bar = life.get(f"{BASE}/remaining-useful-life", params={"method": method, "pressure_bar": 5}).json()
    assert at_five_bar["criterion"]["pressure_bar"] == 5
    assert at_five_bar["status"] in ("predicted", "may_never_reach")
    unknown = life.get(f"{BASE}/remaining-useful-life", params={"method": method, "pressure_bar": 9})
    assert unknown.status_code == 404


def test_the_other_answers_and_their_csv_exports(life: httpx2.Client) -> None:
    every = [1000 * number for number in range(8)]
    degradation = life.get(f"{BASE}/degradation").json()["items"]
    assert {item["quantity"] for item in degradation} == PARAMETERS | {"mean_cof"}
    cof = degradation[0]
    assert (cof["quantity"], cof["pressure_bar"], cof["measured"]["cycles"]) == ("mean_cof", None, every)
    assert set(cof["coefficients"]) == {"initial", "change", "scale_cycles", "exponent"}
    assert cof["coefficients"]["change"]["value"] < 0
    stribeck = life.get(f"{BASE}/stribeck").json()["items"]
    assert [item["cycles"] for item in stribeck] == every
    assert stribeck[0]["pressure_laws"]["static_torque_nm"]["slope_per_bar"] > 0
    assert life.get(f"{BASE}/loops").json() == {"held_runs": 0, "warnings": [], "items": [], "next": None}
    assert {row["quantity"] for row in life.get(f"{BASE}/series").json()["items"]} > PARAMETERS | {"remaining_cycles"}
    tables = {
        "degradation": 21,
        "stribeck": 8 * 4,
        "loops": 0,
        "runs": 8,
        "series": 8 * 4 + 8,
        "remaining-useful-life": 7,
    }
    for name, rows in tables.items():
        answer = life.get(f"{BASE}/{name}.csv", params={"quantity": "mean_cof"} if name == "series" else {})
        assert answer.headers["content-type"] == "text/csv; charset=utf-8"
        assert len(list(csv.DictReader(io.StringIO(answer.text)))) == rows, name
    assert life.get(f"{BASE}/runs/stationary-2000").json()["channels"] == stationary(2000)["channels"]


def test_etags_change_with_the_content_alone_and_what_was_predicted_then_stays(http: httpx2.Client) -> None:
    post_life(http, 3)
    then = http.get(f"{BASE}/remaining-useful-life").json()
    names = ["", "/remaining-useful-life", "/degradation", "/stribeck", "/loops", "/runs", "/series", "/series.csv"]
    tags = {}
    for name in [*names, "/runs/stationary-0"]:
        answer = http.get(BASE + name)
        tags[name] = answer.headers["etag"]
        assert answer.headers["cache-control"] == "no-cache"
        again = http.get(BASE + name, headers={"If-None-Match": tags[name]})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", tags[name])
        assert not tags[name].startswith("W/")
    http.post(f"{BASE}/runs", json=stationary(3000, run_id="stationary-3000"))  # a repeat: nothing changes
    for name, tag in tags.items():
        assert http.get(BASE + name, headers={"If-None-Match": f'"other", {tag}'}).status_code == 304
    http.post(f"{BASE}/runs", json=stationary(4000))
    for name in names:
        changed = http.get(BASE + name, headers={"If-None-Match": tags[name]}).status_code
        assert changed == (304 if name == "/loops" else 200)
    tag = tags["/runs/stationary-0"]
    assert http.get(f"{BASE}/runs/stationary-0", headers={"If-None-Match": tag}).status_code == 304
    for at in (3000, 3999.5):
        earlier = http.get(f"{BASE}/remaining-useful-life", params={"at_cycles": at}).json()
        assert earlier | {"revision": 0} == then | {"revision": 0}
    early = http.get(f"{BASE}/remaining-useful-life", params={"at_cycles": 0}).json()
    assert (early["status"], early["runs_used"]) == ("insufficient_data", 1)
    assert set(early["remaining_cycles"].values()) == {None}
