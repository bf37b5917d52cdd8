"""A run with hot oil is answered by a receipt that says so; one below the criterion is not."""

import tempfile

from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from tests.support import stationary

with tempfile.TemporaryDirectory() as folder:
    app = create_app(Settings(workers=0, database=f"sqlite:///{folder}/a.db"))
    with TestClient(app, base_url="http://127.0.0.1", client=("127.0.0.1", 50000)) as http:
        http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
        for cycles, celsius, expected in ((0.0, 119.0, False), (1000.0, 131.0, True)):
            body = stationary(cycles, pressures=(4.0, 5.0, 6.0))
            body["channels"]["oil_temperature_c"] = [celsius] * len(body["channels"]["torque_nm"])
            receipt = http.post("/v1/clutches/c1/runs", json=body).raise_for_status().json()
            assert ("hot_oil" in [warning["code"] for warning in receipt["warnings"]]) is expected, receipt["warnings"]
