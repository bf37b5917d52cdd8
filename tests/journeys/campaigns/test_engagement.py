"""The engagement of a tracked clutch over the wire."""

import json

import httpx2
import pytest

from models.rig import campaign
from service.run_files.simulated import simulated_body


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
