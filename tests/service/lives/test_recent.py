"""What a list shows of a clutch's latest past: the last run, mean COF as a short line, the newest verdict."""

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.lives.condition import recent
from service.lives.criteria import MAX_LINE_POINTS
from service.lives.history import Event
from service.queries import clutch_list
from tests.support import stationary


def test_a_clutch_says_its_last_run_and_its_mean_cof(client: TestClient) -> None:
    assert client.get("/v1/clutches/c1").json()["recent"] is None
    for cycles, day in ((0, 1), (2000, 3), (1000, 2)):
        body = stationary(cycles, run_id=f"s{cycles}") | {"started_at": f"2026-11-0{day}T08:00:00+01:00"}
        assert client.post("/v1/clutches/c1/runs", json=body).status_code == 201
    one = client.get("/v1/clutches/c1").json()
    assert one == client.get("/v1/clutches").json()["items"][0]
    last = {"run_id": "s2000", "kind": "stationary_stribeck", "cycles": 2000, "at": "2026-11-03T07:00:00+00:00"}
    assert one["recent"]["last_run"] == last
    measured = client.get("/v1/clutches/c1/degradation").json()["items"][0]["measured"]["value"]
    assert one["recent"]["mean_cof"] == pytest.approx(measured, abs=1e-6)
    assert one["diagnosis"] is None


@pytest.mark.parametrize("count", [1, MAX_LINE_POINTS, MAX_LINE_POINTS + 1, 1000])
def test_a_line_is_short_and_ends_with_the_last_value(count: int) -> None:
    series = SimpleNamespace(measurements=[SimpleNamespace(value=float(index)) for index in range(count)])
    events = [Event(run_id="a", kind="maintenance", cycles=5.0, moment=10.0)]
    said = recent(events, series)["mean_cof"]  # type: ignore[arg-type]
    assert len(said) <= MAX_LINE_POINTS
    assert said[-1] == count - 1
    assert len({after - before for before, after in itertools.pairwise(said)}) <= 1


def test_without_a_measurement_there_is_no_line() -> None:
    events = [Event(run_id="a", kind="run_in", cycles=0.0, moment=0.0)]
    assert recent(events, SimpleNamespace(measurements=[]))["mean_cof"] == []  # type: ignore[arg-type]


def test_a_list_is_made_anew_only_after_a_commit(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    page = clutch_list.page_as_json

    def counted(*arguments: Any, **named: Any) -> Any:
        made.append(1)
        return page(*arguments, **named)

    monkeypatch.setattr(clutch_list, "page_as_json", counted)
    first = client.get("/v1/clutches")
    again = client.get("/v1/clutches", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, len(made)) == (304, 1)
    assert client.get("/v1/clutches?limit=1").json() == first.json()
    client.post("/v1/clutches/c1/runs", json=stationary(0))
    later = client.get("/v1/clutches", headers={"If-None-Match": first.headers["etag"]})
    assert (later.status_code, later.json()["items"][0]["runs"], len(made)) == (200, 1, 3)
