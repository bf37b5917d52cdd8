"""Clutches for the pages to show."""

import itertools
import json
import math
from typing import Any

import httpx2
import numpy as np

from service.cli.demo import life as demo_life
from service.runs import simulated
from tests.support import stationary, torque_nm

JSON = {"Content-Type": "application/json"}


def post(http: httpx2.Client, clutch_id: str, body: dict[str, Any]) -> dict[str, Any]:
    """Post a run; its receipt."""
    answer = http.post(f"/v1/clutches/{clutch_id}/runs", json=body)
    assert answer.status_code == 201, answer.text
    found: dict[str, Any] = answer.json()
    return found


def loops(cycles: float, pressures: tuple[float, ...] = (4.0, 5.0, 6.0)) -> dict[str, Any]:
    """A dynamic test: 15 s of a sine at each pressure, torque higher in acceleration than in deceleration."""
    rng = np.random.default_rng([31, int(cycles)])
    time = np.arange(0, 15, 1 / 50)
    phase = 2 * math.pi * 0.1 * time
    speed = 1000 - 1000 * np.cos(phase)
    wear = 0.9 * (1 - (1 + cycles / 6000) ** -0.9)
    channels: dict[str, list[float]] = {name: [] for name in ("time_s", "pressure_bar", "speed_rpm", "torque_nm")}
    for index, pressure in enumerate(pressures):
        torque = [torque_nm(pressure, max(float(n), 1e-9), wear) for n in speed]
        channels["time_s"] += (time + 16 * index).tolist()
        channels["pressure_bar"] += (pressure + 0.005 * rng.standard_normal(time.size)).tolist()
        channels["speed_rpm"] += speed.tolist()
        channels["torque_nm"] += (torque + np.sin(phase) + 0.05 * rng.standard_normal(time.size)).tolist()
    return {"kind": "dynamic_stribeck", "cycles": cycles, "channels": channels}


def worn(http: httpx2.Client, clutch_id: str, last: int = 7000) -> None:
    """A made-up clutch: stationary tests every 1,000 cycles, two dynamic ones, an oil change."""
    http.post("/v1/clutches", json={"clutch_id": clutch_id}).raise_for_status()
    for cycles in range(0, last + 1, 1000):
        post(http, clutch_id, stationary(cycles, pressures=(4.0, 5.0, 6.0)))
    post(http, clutch_id, loops(0))
    post(http, clutch_id, loops(4000))
    post(http, clutch_id, {"kind": "maintenance", "cycles": 4000, "event": "oil_change", "note": "<b>fresh</b> ATF"})


def demo(http: httpx2.Client, seed: int = 1, last: float = math.inf) -> str:
    """The life that `clutchlife demo` simulates, warm oil hidden in it, posted run by run; the clutch's id."""
    clutch_id = f"sim-{seed}"
    http.post("/v1/clutches", json=simulated.simulated_clutch_body(clutch_id)).raise_for_status()
    for run in itertools.takewhile(lambda run: run.cycles <= last, demo_life.runs(seed)):
        body = json.dumps(simulated.simulated_body(run)).encode()
        http.post(f"/v1/clutches/{clutch_id}/runs", content=body, headers=JSON).raise_for_status()
    for cycles, surface in demo_life.inspections(seed, run.cycles):
        inspection = simulated.simulated_inspection(surface, cycles)
        http.post(f"/v1/clutches/{clutch_id}/inspections", json=inspection).raise_for_status()
    return clutch_id
