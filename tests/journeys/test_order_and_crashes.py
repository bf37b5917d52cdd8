"""Runs come in any order, services die at bad moments: what was acknowledged stays, and the answers are the same."""

import json
import threading
import time
from pathlib import Path

import httpx2
import numpy as np
import pytest

from tests.support import Server, serving, stationary

BASE = "/v1/clutches/c1"


def without_revision(http: httpx2.Client, **params: str | float) -> dict[str, object]:
    said: dict[str, object] = http.get(f"{BASE}/remaining-useful-life", params=params).json()
    return said | {"revision": 0}


def test_the_order_of_arrival_does_not_matter(tmp_path: Path) -> None:
    bodies = [stationary(cycles, run_id=f"s{cycles}") for cycles in (0, 500, 1000, 2000, 3000, 4000)]
    bodies += [
        {"kind": "duty_cycles", "cycles": cycles, "duty": {"cycles": 1000}, "run_id": f"d{cycles}"}
        for cycles in (1000, 2000, 5000)
    ]
    answers = []
    for seed in (None, 1):
        order = np.arange(len(bodies)) if seed is None else np.random.default_rng(seed).permutation(len(bodies))
        with serving(tmp_path / f"{seed}.db") as server, httpx2.Client(base_url=server.url, timeout=60) as http:
            http.post("/v1/clutches", json={"clutch_id": "c1"})
            for index in order:
                assert http.post(f"{BASE}/runs", json=bodies[index]).status_code == 201
            answers.append(
                [without_revision(http, method=method) for method in ("particle", "ukf", "grid")]
                + [without_revision(http, at_cycles=2500.0), without_revision(http, pressure_bar=6.0)]
                + [http.get(f"{BASE}/degradation").json()["items"], http.get(f"{BASE}/stribeck").json()]
            )
    assert answers[0] == answers[1]


def test_a_rebuild_starts_a_new_life(http: httpx2.Client) -> None:
    http.post("/v1/clutches", json={"clutch_id": "c1"})
    for cycles in (0, 1000, 2000, 3000):
        http.post(f"{BASE}/runs", json=stationary(cycles))
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


@pytest.mark.parametrize("delay", [0.002, 0.01, 0.02, 0.05])
def test_a_kill_loses_nothing_that_was_acknowledged(tmp_path: Path, delay: float) -> None:
    server = Server(tmp_path / "clutchlife.db")
    server.start()
    acknowledged: list[str] = []
    with httpx2.Client(base_url=server.url, timeout=60) as http:
        http.post("/v1/clutches", json={"clutch_id": "c1"})

        def post() -> None:
            for index in range(200):
                body = stationary(100 * index, run_id=f"run-{index}")
                try:
                    answer = http.post(
                        f"{BASE}/runs", content=json.dumps(body), headers={"Content-Type": "application/json"}
                    )
                except httpx2.TransportError:
                    return
                assert answer.status_code == 201
                acknowledged.append(answer.json()["run_id"])

        poster = threading.Thread(target=post)
        poster.start()
        while len(acknowledged) < 3:
            time.sleep(0.001)
        time.sleep(delay)
        server.kill()
        poster.join()
    server.start()
    try:
        with httpx2.Client(base_url=server.url, timeout=60) as http:
            stored = [item["run_id"] for item in http.get(f"{BASE}/runs", params={"limit": 1000}).json()["items"]]
            assert set(acknowledged) <= set(stored)
            assert len(stored) <= len(acknowledged) + 1
            said = without_revision(http)
            assert said["runs_used"] == len(stored)
            body = stationary(100 * len(stored), run_id="after")
            assert http.post(f"{BASE}/runs", json=body).status_code == 201
    finally:
        assert server.stop() in (0, -15)


def test_many_writers_at_once(server: Server) -> None:
    failures: list[str] = []

    def rig(name: str) -> None:
        with httpx2.Client(base_url=server.url, timeout=60) as http:
            http.post("/v1/clutches", json={"clutch_id": name})
            for cycles in (0, 1000, 2000, 3000):
                answer = http.post(f"/v1/clutches/{name}/runs", json=stationary(cycles, run_id=f"r{cycles}"))
                if answer.status_code != 201:
                    failures.append(answer.text)

    rigs = [threading.Thread(target=rig, args=(f"rig-{index}",)) for index in range(6)]
    for each in rigs:
        each.start()
    for each in rigs:
        each.join()
    assert failures == []
    with httpx2.Client(base_url=server.url) as http:
        assert [item["runs"] for item in http.get("/v1/clutches").json()["items"]] == [4] * 6
