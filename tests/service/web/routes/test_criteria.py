"""Lives that end by more than mean COF, and tracks of any quantity, over HTTP."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.clutch import Geometry
from models.friction.stribeck import StribeckParameters, torque
from models.rig.campaign import simulate
from models.rig.programme import RigProgramme
from models.rig.sampled import DynamicTest
from service.runs.simulated import simulated_body
from tests.service.clients import filled_client, post_run
from tests.support import one_quick

WAIT = {"Prefer": "wait=60"}
SHUDDER = {"quantity": "slope", "pressure_bar": 5, "speed_rpm": 100}


@filled_client
def tested(client: TestClient) -> None:
    """A simulated clutch whose friction soon falls with speed at 100 rpm, six tests with loops."""
    record = {"clutch_id": "s", "origin": "simulated", "end_of_life": {"criteria": [{"quantity": "mean_cof"}, SHUDDER]}}
    assert client.post("/v1/clutches", json=record).status_code == 201
    for run in simulate(7, most_tests=6, programme=RigProgramme(dynamic=DynamicTest(rate=25.0, pressures=(5e5, 7e5)))):
        post_run(client, simulated_body(run), "s")


def asked(client: TestClient, path: str, **query: Any) -> dict[str, Any]:
    answer = client.get(f"/v1/clutches/s/{path}", params=query, headers=WAIT)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_clutch_that_shudders_first_is_said_so(tested: TestClient) -> None:
    answer = asked(tested, "remaining-useful-life")
    cof, slope = answer["criteria"]
    assert (cof["quantity"], slope["quantity"], slope["limit"]) == ("mean_cof", "slope", 0.0)
    assert cof["probability_first"] + slope["probability_first"] == pytest.approx(1.0, abs=0.01)
    assert slope["probability_first"] > 0.9
    assert answer["criterion"]["quantity"] == "slope"
    assert answer["end_of_life_cycles"]["0.5"] < cof["end_of_life_cycles"]["0.5"]
    by_cof = asked(tested, "remaining-useful-life", criterion="mean_cof")
    assert by_cof["criterion"]["quantity"] == "mean_cof"
    assert by_cof["end_of_life_cycles"] == cof["end_of_life_cycles"]


def test_a_query_takes_the_names_that_criteria_take(tested: TestClient) -> None:
    names = {"static_ratio": "breakaway_cof_ratio", "stop_time": "stop_time_s", "energy": "engagement_energy_kj"}
    for alias, name in names.items():
        by_alias, by_name = (asked(tested, "degradation", quantity=quantity) for quantity in (alias, name))
        assert by_alias["items"] == by_name["items"], alias
        answer = tested.get("/v1/clutches/s/remaining-useful-life", params={"quantity": alias}, headers=WAIT)
        assert answer.status_code == 200 or name in answer.json()["detail"]
    none = tested.get("/v1/clutches/s/degradation", params={"quantity": "nonsense"}, headers=WAIT)
    assert (none.status_code, "film_time" in none.json()["detail"]) == (422, True)
    unmeasured = tested.get("/v1/clutches/s/remaining-useful-life", params={"criterion": "film_time"}, headers=WAIT)
    assert unmeasured.status_code == 404


def test_mean_cof_alone_is_one_criterion_and_as_it_was(tested: TestClient) -> None:
    edit = {"end_of_life": {"cof_fraction": 0.5}, "reason": "shudder is looked at elsewhere"}
    assert tested.patch("/v1/clutches/s", json=edit).status_code == 200
    answer = asked(tested, "remaining-useful-life")
    (only,) = answer["criteria"]
    assert (only["quantity"], only["probability_first"]) == ("mean_cof", 1.0)
    for name in ("remaining_cycles", "end_of_life_cycles", "probability_of_reaching"):
        assert only[name] == answer[name]
    assert answer["criterion"]["threshold_mean_cof"] == only["limit"]


@pytest.mark.parametrize("method", one_quick(["particle", "ukf", "grid"]))
@pytest.mark.parametrize("quantity", ["static_torque_nm", "film_time"])
def test_every_filter_tracks_parameters_and_lag(tested: TestClient, method: str, quantity: str) -> None:
    answer = asked(tested, "degradation", quantity=quantity, method=method, draws=20)
    assert answer["method"] == method
    # at low pressure the film time of this rig does not change, and nothing is known of its course
    item = max(answer["items"], key=lambda item: (len(item["measured"]["cycles"]), item["pressure_bar"]))
    assert item["frequency_hz"] == (0.1 if quantity == "film_time" else None)
    band = item["trajectory"]
    assert all(low < high for low, high in zip(band["lower"], band["upper"], strict=True))
    assert {len(column) for column in item["draws"].values()} == {20}
    quantiles = list(item["coefficients"]["initial"]["quantiles"].values())
    assert quantiles == sorted(quantiles)
    correlations = np.array(item["correlations"])
    assert correlations == pytest.approx(correlations.T)
    assert np.diag(correlations).tolist() == [1.0] * 4
    assert correlations[2, 3] > 0.0  # scale and exponent: the ridge of eq. 6


def test_slopes_fall_with_use_and_a_lower_speed_reaches_zero_later(tested: TestClient) -> None:
    items = asked(tested, "degradation", quantity="slope")["items"]
    assert {item["speed_rpm"] for item in items} == {50.0, 100.0, 500.0}
    by_speed = {item["speed_rpm"]: item for item in items if item["pressure_bar"] == 5.0}
    median = {speed: np.array(item["trajectory"]["median"]) for speed, item in by_speed.items()}
    below = {speed: int((values < 0.0).sum()) for speed, values in median.items()}
    assert below[500.0] > below[100.0] > below[50.0]
    assert median[100.0][-1] < median[100.0][0]


def test_an_earlier_life_stays_reachable(tested: TestClient) -> None:
    before = asked(tested, "degradation", quantity="mean_cof")
    last = before["items"][0]["measured"]["cycles"][-1]
    rebuild = {"kind": "maintenance", "event": "rebuild", "cycles": last + 1, "run_id": "new-lining"}
    assert tested.post("/v1/clutches/s/runs", json=rebuild).status_code == 201
    now = asked(tested, "degradation", quantity="mean_cof")
    assert now["life"] == {"number": 2, "of": 2, "from_cycles": last + 1, "rebuild": "new-lining"}
    assert now["items"] == []
    earlier = asked(tested, "degradation", quantity="mean_cof", life=1)
    assert earlier["items"] == before["items"]
    ended = asked(tested, "remaining-useful-life", life=1)
    assert ended["life"]["number"] == 1
    assert ended["status"] != "insufficient_data"
    assert asked(tested, "remaining-useful-life")["status"] == "insufficient_data"


def test_too_few_tests_of_a_quantity_name_that_quantity_and_what_was_known_then_is_answered_for_then(
    tested: TestClient,
) -> None:
    assert tested.post("/v1/clutches", json={"clutch_id": "s2", "origin": "simulated"}).status_code == 201
    for run in simulate(7, most_tests=2):
        assert tested.post("/v1/clutches/s2/runs", json=simulated_body(run)).status_code == 201
    query = {"quantity": "static_torque_nm", "pressure_bar": 5}
    answer = tested.get("/v1/clutches/s2/remaining-useful-life", params=query, headers=WAIT).json()
    assert answer["status"] == "insufficient_data"
    assert answer["criterion"]["quantity"] == "static_torque_nm"
    assert tested.get("/v1/clutches/s/degradation", params={"life": 3}, headers=WAIT).status_code == 404
    items = asked(tested, "degradation", quantity="static_torque_nm", at_cycles=2_000)["items"]
    assert all(item["measured"]["cycles"] == [0, 500, 1_000, 2_000] for item in items)


def test_a_slope_in_the_rows_is_the_difference_of_the_curve_that_the_receipt_shows(tested: TestClient) -> None:
    """1e-4: near its change of sign a slope is a small difference, and the central one is off by some 1e-6 of it."""
    geometry = Geometry()
    rows = [row for row in asked(tested, "series", quantity="slope")["items"] if row["speed_rpm"] == 100]
    for row in rows[:: len(rows) // 3]:
        run = asked(tested, f"runs/{row['run_id']}")
        (fit,) = (fit for fit in run["fits"] if fit["pressure_bar"] == row["pressure_bar"])
        parameters = StribeckParameters.from_array(np.array(list(fit["parameters"].values())))
        measured = np.array(run["channels"]["pressure_bar"])
        pressure = 1e5 * float(measured[np.abs(measured - row["pressure_bar"]) < 0.1].mean())
        velocity = 100 * np.pi / 30 * geometry.mean_radius * np.array([0.999, 1.001])
        low, high = torque(velocity, parameters) / geometry.torque_per_cof(pressure)
        assert row["value"] == pytest.approx((high - low) / (velocity[1] - velocity[0]), rel=1e-4)


@pytest.mark.parametrize(
    ("criterion", "said"),
    [
        ({"quantity": "slope", "pressure_bar": 5}, "speed_rpm must be given"),
        ({"quantity": "film_time", "pressure_bar": 5, "below": 0.1}, "frequency_hz must be given"),
        ({"quantity": "static_torque_nm", "fraction": 0.5}, "pressure_bar must be given"),
        ({"quantity": "mean_cof", "fraction": 0.5, "below": 0.1}, "exactly one of"),
        (SHUDDER | {"fraction": 0.5}, "changes sign"),
        ({"quantity": "noise", "below": 1}, "quantity"),
    ],
)
def test_a_criterion_that_is_none_is_refused(client: TestClient, criterion: dict[str, Any], said: str) -> None:
    answer = client.post("/v1/clutches", json={"clutch_id": "x", "end_of_life": {"criteria": [criterion]}})
    assert answer.status_code == 422
    assert said in answer.text
