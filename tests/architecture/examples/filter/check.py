"""A service with the new filter answers for it, and its remaining life is close to that of the exact filter."""

import tempfile

from tests.service.clients import client_on
from tests.support import stationary

with tempfile.TemporaryDirectory() as folder, client_on(f"sqlite:///{folder}/a.db") as http:
    http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
    for number in range(9):
        body = stationary(1000.0 * number, pressures=(4.0, 5.0, 6.0))
        http.post("/v1/clutches/c1/runs", json=body).raise_for_status()
    median = {}
    for method in ("grid", "importance"):
        answer = http.get("/v1/clutches/c1/remaining-useful-life", params={"method": method})
        median[method] = answer.raise_for_status().json()["end_of_life_cycles"]["0.5"]
assert abs(median["importance"] / median["grid"] - 1.0) < 0.2, median
