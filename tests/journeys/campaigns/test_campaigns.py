"""Whole campaigns over a real socket."""

import json
import math
from pathlib import Path
from typing import Any

import httpx2
import pytest

from models.rig import campaign
from service.runs.simulated import simulated_body
from tests.support import Server, clutchlife, stationary

# --- Simulated campaigns go through the whole way in text and in a binary format: simulate, push, receipts.


@pytest.mark.slow
def test_campaigns_of_records_are_pushed_without_a_word_on_kind_and_cycles(server: Server, tmp_path: Path) -> None:
    for form in ("csv", "mdf4"):
        folder = tmp_path / form
        assert "3 simulated runs" in clutchlife("simulate", "--film", "--out", folder, "--format", form, "--tests", "1")
        clutchlife("register", form, "--record", folder / "clutch.json", "--url", server.url)
        push = ("push", folder, "--clutch", form, "--url", server.url, "--spool", tmp_path / "spool")
        assert "4 stored now, 0 stored before, 0 refused" in clutchlife(*push)
        assert "0 stored now, 4 stored before, 0 refused" in clutchlife(*push)
        (inspection,) = server.http.get(f"/v1/clutches/{form}/inspections").json()["items"]
        assert (inspection["cycles"], inspection["roughness_um"], inspection["skewness"]) == (0, 9.52, -0.87)
        items = server.http.get(f"/v1/clutches/{form}/runs").json()["items"]
        runs: dict[str, dict[str, Any]] = {run["kind"]: run for run in items}
        assert set(runs) == {"run_in", "stationary_stribeck", "dynamic_stribeck"}
        assert {(run["origin"], run["cycles"]) for run in items} == {("simulated", 0)}
        assert len(runs["stationary_stribeck"]["fits"]) == 7
        loops = runs["dynamic_stribeck"]["loops"]
        assert [loop["pressure_bar"] for loop in loops] == [4, 4.5, 5, 5.5, 6, 6.5, 7]
        assert {loop["direction"] for loop in loops} == {"higher_accelerating"}
        assert runs["run_in"]["duty"]["energy_per_cycle_kj"] > 0


def test_a_record_that_no_manifest_lists_is_named(server: Server, tmp_path: Path) -> None:
    folder = tmp_path / "sent"
    folder.mkdir()
    (folder / "first.json").write_text(json.dumps(stationary(0.0, run_id="first")), encoding="utf-8")
    (folder / "lonely.csv").write_text("torque_nm\n1\n", encoding="utf-8")
    server.http.post("/v1/clutches", json={"clutch_id": "c1"})
    output = clutchlife("push", folder, "--clutch", "c1", "--url", server.url, "--spool", tmp_path / "spool")
    assert "not sent, because kind and cycles are not known: " in output
    assert "lonely.csv" in output
    assert "1 stored" in output


# --- The engagement of a tracked clutch over the wire.


@pytest.mark.slow
def test_a_tracked_clutch_engages_slower_as_it_wears(http: httpx2.Client) -> None:
    http.post("/v1/clutches", json={"clutch_id": "c1", "origin": "simulated"})
    assert http.get("/v1/clutches/c1/engagement").status_code == 404
    for run in campaign.simulate(4, most_tests=5):
        http.post(
            "/v1/clutches/c1/runs",
            content=json.dumps(simulated_body(run)),
            headers={"Content-Type": "application/json"},
        )
    traces = [http.get("/v1/clutches/c1/engagement", params={"at_cycles": cycles}).json() for cycles in (0, 1000, 3000)]
    assert [trace["at_cycles"] for trace in traces] == [0, 1000, 3000]
    assert all(trace["engaged"] and trace["simulated"] for trace in traces)
    durations = [trace["duration_s"] for trace in traces]
    assert durations == sorted(durations)
    assert durations[-1] > 1.1 * durations[0]
    for trace in traces:
        assert len({len(column) for column in trace["channels"].values()}) == 1
        assert max(trace["channels"]["pressure_bar"]) == 8
        assert max(trace["channels"]["motor_torque_nm"]) == trace["motor_torque_limit_nm"] == 20
    now = http.get("/v1/clutches/c1/engagement").json()
    assert now == traces[-1]


# --- A fleet is learned from while the service runs, and the commands tell what the service tells.

SPEEDS = tuple(range(20, 1971, 150))


def post(http: httpx2.Client, name: str, scale: float, last: int) -> None:
    assert http.post("/v1/clutches", json={"clutch_id": name}).status_code == 201
    for cycles in range(0, last + 1, 2000):
        wear = 0.9 * (1 - (1 + cycles / scale) ** -0.9) + 0.002 * math.sin(cycles)
        body = stationary(cycles, wear=wear, speeds=SPEEDS, pressures=(5.0,), run_id=f"t{cycles}")
        assert http.post(f"/v1/clutches/{name}/runs", json=body).status_code == 201


@pytest.mark.slow
def test_a_fleet_is_refreshed_and_scored_beside_the_service(server: Server) -> None:
    http = server.http
    database = ("--database", f"sqlite:///{server.database}")
    assert "no prior has been learned" in clutchlife("fleet", *database)
    assert "nothing to score" in clutchlife("score", *database)
    for number, scale in enumerate((4000.0, 5000.0, 6000.0)):
        post(http, f"old-{number}", scale, 18_000)
    post(http, "young", 5000.0, 4000)
    before = http.get("/v1/clutches/young/remaining-useful-life")
    refreshed = clutchlife("fleet", "refresh", *database)
    assert "version 1, 3 clutches" in refreshed
    assert "young: predictions updated" in refreshed
    after = http.get("/v1/clutches/young/remaining-useful-life", headers={"If-None-Match": before.headers["etag"]})
    assert after.status_code == 200
    assert after.json()["prior"] == {"name": "fleet", "version": 1, "clutches": 3}
    assert after.json()["revision"] == before.json()["revision"] + 1
    assert "version 1, 3 clutches" in clutchlife("fleet", *database)
    for where in (database, ("--url", server.url)):
        assert "predictions updated" not in clutchlife("fleet", "refresh", *where)
        assert "version 1, 3 clutches" in clutchlife("fleet", *where)
    output = clutchlife("score", *database)
    scores = http.get("/v1/fleet/scores").json()
    assert len(scores["lives"]) >= 2
    for life in scores["lives"]:
        assert f"{life['clutch_id']}: ended at {life['end_of_life_cycles']:.0f} cycles" in output
    assert f"{scores['overall']['coverage']:.3f}" in output.splitlines()[-1]
    # what a posted run gets under the fleet's prior is what a replay makes of it
    clutchlife("replay", "young", *database)
    again = http.get("/v1/clutches/young/remaining-useful-life").json()
    assert json.dumps(again) == json.dumps(after.json())
