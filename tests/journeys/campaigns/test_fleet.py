"""A fleet is learned from while the service runs, and the commands tell what the service tells."""

import json
import math
from collections.abc import Iterator

import httpx2
import pytest

from tests.support import Server, clutchlife, stationary

SPEEDS = tuple(range(20, 1971, 150))


def post(http: httpx2.Client, name: str, scale: float, last: int) -> None:
    assert http.post("/v1/clutches", json={"clutch_id": name}).status_code == 201
    for cycles in range(0, last + 1, 2000):
        wear = 0.9 * (1 - (1 + cycles / scale) ** -0.9) + 0.002 * math.sin(cycles)
        body = stationary(cycles, wear=wear, speeds=SPEEDS, pressures=(5.0,), run_id=f"t{cycles}")
        assert http.post(f"/v1/clutches/{name}/runs", json=body).status_code == 201


@pytest.fixture
def http(server: Server) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=server.url, timeout=60) as client:
        yield client


@pytest.mark.slow
def test_a_fleet_is_refreshed_and_scored_beside_the_service(server: Server, http: httpx2.Client) -> None:
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
    assert "predictions updated" not in clutchlife("fleet", "refresh", *database)
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
