"""A run with hot oil is answered by a receipt that says so; one below the criterion is not."""

import tempfile

from tests.service.clients import client_on
from tests.support import stationary

with tempfile.TemporaryDirectory() as folder, client_on(f"sqlite:///{folder}/a.db") as http:
    http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
    for cycles, celsius, expected in ((0.0, 119.0, False), (1000.0, 131.0, True)):
        body = stationary(cycles, pressures=(4.0, 5.0, 6.0))
        body["channels"]["oil_temperature_c"] = [celsius] * len(body["channels"]["torque_nm"])
        receipt = http.post("/v1/clutches/c1/runs", json=body).raise_for_status().json()
        assert ("hot_oil" in [warning["code"] for warning in receipt["warnings"]]) is expected, receipt["warnings"]
