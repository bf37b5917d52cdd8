"""A test whose oil is much colder than the first test's is said so, and no track follows it, whenever it arrives."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.lives.assumptions import Assumptions, ModelInForce
from service.lives.history import Event, Life
from tests.service.clients import client_on
from tests.support import stationary

BASE = "/v1/clutches/c1"


def sweep(cycles: float, oil_c: float | None, gain: float = 1.0) -> dict[str, Any]:
    """A stationary test with its oil at some temperature, and torque so many times what it would be."""
    run = stationary(cycles, run_id=f"at-{cycles:g}", pressures=(5.0, 6.0))
    channels = run["channels"]
    channels["torque_nm"] = (gain * np.array(channels["torque_nm"])).tolist()
    if oil_c is not None:
        channels["oil_temperature_c"] = [oil_c] * len(channels["torque_nm"])
    return run


def codes(client: TestClient, run_id: str) -> list[str]:
    return [warning["code"] for warning in client.get(f"{BASE}/runs/{run_id}").json()["warnings"]]


def post(client: TestClient, run: dict[str, Any]) -> dict[str, Any]:
    answer = client.post(f"{BASE}/runs", json=run)
    assert answer.status_code == 201, answer.text
    receipt: dict[str, Any] = answer.json()
    return receipt


def life(client: TestClient) -> dict[str, Any]:
    answer: dict[str, Any] = client.get(f"{BASE}/remaining-useful-life", params={"method": "grid"}).json()
    return answer


USUAL = [sweep(1000.0 * place, 80.0 + 2.5 * place) for place in range(4)]
COLD = sweep(2500.0, 40.0, gain=1.08)


def test_a_test_in_cold_oil_is_said_so_and_not_tracked(client: TestClient) -> None:
    for run in USUAL:
        assert post(client, run)["warnings"] == []
    before = life(client)
    receipt = post(client, COLD)
    warned = {warning["code"]: warning["message"] for warning in receipt["warnings"]}
    assert receipt["state"] == "accepted"
    assert warned.keys() == {"late_arrival", "other_oil_temperature"}
    assert "was 40 °C in this test" in warned["other_oil_temperature"]
    assert "80 °C" in warned["other_oil_temperature"]
    after = life(client)
    assert after["runs_used"] == 4
    for part in ("current", "end_of_life_cycles"):
        assert after[part] == before[part]
    parameters = client.get(f"{BASE}/degradation").json()["items"]
    assert {len(item["measured"]["cycles"]) for item in parameters} == {4}


def test_the_same_torque_in_usual_oil_is_tracked(client: TestClient) -> None:
    """The control: what keeps the cold test out is its oil; one without a measured temperature counts too."""
    for run in [*USUAL, sweep(4000.0, 90.0), sweep(5000.0, None)]:
        assert "other_oil_temperature" not in [warning["code"] for warning in post(client, run)["warnings"]]
    assert life(client)["runs_used"] == 6


def test_whatever_the_order_the_first_test_by_cycles_is_the_reference(client: TestClient, tmp_path: Path) -> None:
    """The cold test comes first and is the reference until those before it by cycles arrive."""
    for run in (COLD, *reversed(USUAL)):
        post(client, run)
    names = [run["run_id"] for run in (*USUAL, COLD)]
    assert [name for name in names if "other_oil_temperature" in codes(client, name)] == [COLD["run_id"]]
    answers = [life(client)]
    with client_on(f"sqlite:///{tmp_path / 'in_order.db'}") as other:
        assert other.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        for run in sorted((*USUAL, COLD), key=lambda run: float(run["cycles"])):
            post(other, run)
        answers.append(life(other))
    assert answers[0]["end_of_life_cycles"] == answers[1]["end_of_life_cycles"]
    assert [answer["runs_used"] for answer in answers] == [4, 4]


@pytest.mark.parametrize(
    ("effects", "measured"), [([], 1), (["torque_zero_shift"], 1), (["interface_heating", "oil_temperature"], 2)]
)
def test_a_model_that_corrects_for_the_oil_has_its_mean_cof_tracked(effects: list[str], measured: int) -> None:
    warm = Event(
        run_id="warm",
        kind="stationary_stribeck",
        cycles=0.0,
        moment=0.0,
        oil_temperature=358.0,
        cofs={5e5: (0.1, 0.001)},
    )
    cold = replace(warm, run_id="cold", cycles=1000.0, oil_temperature=313.0)
    tested_life = Life(origin=0.0, events=(warm, cold))
    under = Assumptions(model=ModelInForce(name={"name": "extended", "effects": effects}))
    assert len(tested_life.pooled(under).measurements) == measured
    # Stribeck parameters are those of the baseline's fits: nothing corrects them
    parameter = tested_life.series(under, "static_torque_nm", 5e5, [(20.0, 0.1), (22.0, 0.1)])
    assert len(parameter.measurements) == 1
