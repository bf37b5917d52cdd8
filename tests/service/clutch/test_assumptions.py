"""What a clutch is tracked under shows in every answer: severity, events that shift the level, tests off the track."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from models.degradation.severity import Block, Severity, SeverityBasis
from service.api.base import MAX_TORQUE_FILTER_MS
from service.clutch.assumptions import Assumptions
from service.clutch.criteria import SEVERITY_EXPONENTS
from service.clutch.severity_estimate import severity_estimate
from service.clutch.timeline import Event, Life
from tests.service.answers.test_scores import mean_torque
from tests.service.changes.test_learn_fleet import SPEEDS
from tests.service.clients import client_on, post_run
from tests.support import post_tests, stationary

HEAVY, LIGHT = 40.0, 10.0


def wear(zeta: float) -> float:
    return float(0.9 * (1 - (1 + zeta / 12_000) ** -0.9))


def measure(client: TestClient, name: str, cycles: float, share: float) -> None:
    body = stationary(cycles, wear=share, speeds=SPEEDS, pressures=(5.0,), run_id=f"t{cycles:g}", noise=0.003)
    post_run(client, body, name)


def duty(client: TestClient, name: str, cycles: float, energy: float) -> None:
    block = {"cycles": 1000, "energy_per_cycle_kj": energy}
    post_run(client, {"kind": "duty_cycles", "cycles": cycles, "duty": block, "run_id": f"d{cycles:g}"}, name)


def said(client: TestClient, name: str, **asked: str | float) -> dict[str, Any]:
    return client.get(f"/v1/clutches/{name}/remaining-useful-life", params=asked).json()


@pytest.mark.slow
def test_energy_as_severity_predicts_the_recent_duty(client: TestClient) -> None:
    """Light blocks, then heavy ones: wear goes with energy, and the remaining cycles are cycles of heavy duty."""
    for name, counted in (("by-energy", "dissipated_energy"), ("by-cycles", "cycles")):
        assert client.post("/v1/clutches", json={"clutch_id": name, "severity": {"basis": counted}}).status_code == 201
        zeta = 0.0
        measure(client, name, 0, 0.0)
        for block in range(1, 9):
            energy = LIGHT if block <= 5 else HEAVY
            zeta += 1000.0 * energy / LIGHT
            duty(client, name, 1000.0 * block, energy)
            measure(client, name, 1000.0 * block, wear(zeta))
    half = 0.5 * mean_torque(0.0)
    true = next(n for n in range(0, 10**5, 10) if mean_torque(wear(17_000.0 + 4.0 * n)) < half)
    by_energy, by_cycles = (said(client, name) for name in ("by-energy", "by-cycles"))
    assert by_energy["severity"] == {"basis": "dissipated_energy", "exponent": 1.0}
    assert by_cycles["severity"] == {"basis": "cycles", "exponent": 1.0}
    low, high = (by_energy["remaining_cycles"][q] for q in ("0.05", "0.95"))
    assert low < true < high
    assert abs(by_energy["remaining_cycles"]["0.5"] - true) < abs(by_cycles["remaining_cycles"]["0.5"] - true)
    # what the record counts is weighed against other exponents, and doubted where the tests contradict it
    weighed = {name: client.get(f"/v1/clutches/{name}/degradation").json() for name in ("by-energy", "by-cycles")}
    for name, answer in weighed.items():
        estimate = answer["severity_estimate"]
        assert estimate["basis"] == "dissipated_energy"
        assert estimate["exponents"][int(np.argmax(estimate["probabilities"]))] == 1.0
        assert ("severity_exponent" in {warning["code"] for warning in answer["warnings"]}) is (name == "by-cycles")
    # as it would have been said after the light blocks: cycles of light duty
    then = said(client, "by-energy", at_cycles=5000)
    assert then["remaining_cycles"]["0.5"] > 2.0 * by_energy["remaining_cycles"]["0.5"]


@pytest.mark.slow
def test_by_energy_too_the_order_of_arrival_does_not_matter(tmp_path: Path) -> None:
    """The blocks tell what the tests' ζ is: a block that comes after its test moves it."""
    posts = [(measure, 1000.0 * i, wear(1000.0 * i)) for i in range(5)]
    posts += [(duty, 1000.0 * i, LIGHT if i % 2 else HEAVY) for i in range(1, 5)]
    answers = []
    for place, order in enumerate((range(9), (8, 3, 1, 7, 0, 5, 2, 6, 4))):
        with client_on(f"sqlite:///{tmp_path / f'{place}.db'}") as client:
            client.post("/v1/clutches", json={"clutch_id": "c1", "severity": {"basis": "dissipated_energy"}})
            for post, cycles, value in (posts[index] for index in order):
                post(client, "c1", cycles, value)
            answers.append([said(client, "c1", method=method) for method in ("particle", "ukf", "grid")])
    # at equal cycles runs stand by when they were received, so only what is said at the end is the same
    assert [each["end_of_life_cycles"] for each in answers[0]] == [each["end_of_life_cycles"] for each in answers[1]]


def test_a_step_after_an_oil_change_does_not_look_like_wear(client: TestClient) -> None:
    """The same drop of 6 % with and without an event between the tests: with it, it is a step of the level."""
    for name in ("told", "untold"):
        client.post("/v1/clutches", json={"clutch_id": name})
        for i in range(10):
            if i == 8 and name == "told":
                post_run(client, {"kind": "maintenance", "cycles": 7500, "event": "oil_change"}, name)
            measure(client, name, 1000 * i, wear(1000.0 * i) + (0.06 if i >= 8 else 0.0))
    warned = {name: [each["code"] for each in said(client, name)["warnings"]] for name in ("told", "untold")}
    assert warned == {"told": [], "untold": ["new_level"]}


@pytest.mark.parametrize(
    "record",
    [
        *({"severity": wrong} for wrong in ({"basis": "time"}, {"exponent": -1}, {"exponent": 11}, {"unit": 1})),
        *({"torque_filter_ms": wrong} for wrong in (-1, MAX_TORQUE_FILTER_MS + 1, "20", True)),
    ],
)
def test_a_severity_or_a_filter_that_is_none_is_refused(client: TestClient, record: dict[str, object]) -> None:
    answer = client.post("/v1/clutches", json={"clutch_id": "wrong"} | record)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"].startswith(f"/{next(iter(record))}")


def test_surfaces_of_torque_fall_along_the_life_and_rise_with_pressure(client: TestClient) -> None:
    before = said(client, "c1")  # the first test
    assert before["model"] == {"name": "baseline", "effects": []}
    assert before["prior"] == {"name": "weak", "version": None, "clutches": 0}
    assert before["warnings"] == []
    assert client.get("/v1/clutches/c1/surfaces").status_code == 404
    post_tests(client, *range(0, 8000, 1000), pressures=(4.0, 5.0, 6.0))
    surfaces = client.get("/v1/clutches/c1/surfaces").json()
    shape = [len(surfaces[name]) for name in ("cycles", "pressure_bar", "speed_rpm")]
    assert shape == [15, 13, 20]
    first, last = surfaces["torque_nm"][0], surfaces["torque_nm"][-1]
    assert all(last[j][k] < first[j][k] for j in range(13) for k in range(20))
    assert surfaces["torque_nm"][0][12][10] > 1.3 * surfaces["torque_nm"][0][0][10]
    assert len(client.get("/v1/clutches/c1/surfaces.csv").text.splitlines()) == 1 + 15 * 13 * 20


# --- The exponent of severity that the tests of one life speak for, where the energy of its duty steps.

PRESSURE, TESTS, EVERY, SCATTER = 5e5, 25, 1_000.0, 0.003


def life(exponent: float, steps: tuple[float, ...] = (10e3, 20e3, 40e3), seed: int = 1) -> Life:
    """Duty in as many stages as `steps` [J], and a test after every block; wear by eq. 6 over ∫ (E/E_first)^q dn."""
    rng, zeta, events = np.random.default_rng(seed), 0.0, []
    for test in range(TESTS):
        cycles = EVERY * test
        if test:
            energy = steps[(test - 1) * len(steps) // (TESTS - 1)]
            zeta += EVERY * (energy / steps[0]) ** exponent
            at = {"run_id": f"d{test}", "cycles": cycles, "moment": 2.0 * test, "arrived": 2.0 * test}
            events.append(Event(kind="duty_cycles", duty=Block(end=cycles, cycles=EVERY, energy=energy), **at))
        cof = 0.13 * (1.0 - 0.75 * (1.0 - (1.0 + zeta / 12_000.0) ** -0.8)) * (1.0 + SCATTER * rng.standard_normal())
        at = {"run_id": f"t{test}", "cycles": cycles, "moment": 2.0 * test + 1.0, "arrived": 2.0 * test + 1.0}
        measured = {"speed_range": (1.0, 200.0), "cofs": {PRESSURE: (cof, 0.001 * cof)}}
        events.append(Event(kind="stationary_stribeck", **at, **measured))
    return Life(origin=0.0, events=tuple(events))


@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.0])
def test_energy_that_steps_tells_its_exponent_and_doubts_another(exponent: float) -> None:
    """By cycles, whose exponent is 0, where wear goes with energy."""
    found = severity_estimate(life(exponent), Assumptions())
    assert found.basis is SeverityBasis.DISSIPATED_ENERGY
    assert found.likeliest == exponent
    assert found.probability[SEVERITY_EXPONENTS.index(exponent)] > 0.5
    assert found.probability.sum() == pytest.approx(1.0)
    assert abs(found.mean - exponent) < 3.0 * max(found.deviation, 0.05)
    by_cycles, work = Severity(basis=SeverityBasis.CYCLES), SeverityBasis.DISSIPATED_ENERGY
    doubts = found.doubts(by_cycles)
    assert [doubt.code for doubt in doubts] == ["severity_exponent"] * (exponent > 0)
    assert all(f"wear grows with dissipated energy to the power of {exponent:g}" in doubt.message for doubt in doubts)
    assert found.doubts(Severity(basis=work, exponent=exponent) if exponent else by_cycles) == []


def test_nothing_is_weighed_where_nothing_tells() -> None:
    """Constant duty, and too few tests."""
    assert severity_estimate(life(1.0, steps=(20e3,)), Assumptions()) is None
    assert severity_estimate(life(1.0, steps=(20e3, 20.5e3)), Assumptions()) is None
    assert severity_estimate(life(1.0, steps=(10e3, 40e3)).until(4), Assumptions()) is None
