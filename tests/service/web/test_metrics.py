"""Metrics count what happened, by route and not by name."""

from fastapi.testclient import TestClient

from tests.support import stationary


def test_requests_and_clutches_are_counted(client: TestClient) -> None:
    for cycles in (0, 1000, 2000):
        assert client.post("/v1/clutches/c1/runs", json=stationary(cycles)).status_code == 201
    client.get("/v1/clutches/nobody")
    client.get("/no/such/place")
    said = client.get("/metrics")
    assert said.headers["content-type"].startswith("text/plain; version=0.0.4")
    lines = said.text.splitlines()
    posted = 'clutchlife_requests_total{method="POST",route="/v1/clutches/{clutch_id}/runs",status="201"} 3.0'
    assert posted in lines
    assert 'clutchlife_requests_total{method="GET",route="/v1/clutches/{clutch_id}",status="404"} 1.0' in lines
    assert 'clutchlife_requests_total{method="any",route="unmatched",status="404"} 1.0' in lines
    assert 'clutchlife_clutch_runs{clutch="c1"} 3.0' in lines
    health = next(line for line in lines if line.startswith('clutchlife_clutch_health{clutch="c1"}'))
    assert 0 < float(health.split()[-1]) <= 1
    assert any(line.startswith('clutchlife_clutch_remaining_cycles{clutch="c1",quantile="0.5"}') for line in lines)
    assert "nobody" not in said.text
