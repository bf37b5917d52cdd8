"""What a list shows of a clutch's latest past: the last run, mean COF as a short line, the newest verdict."""

import itertools
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.lives.condition import recent
from service.lives.criteria import MOST_LINE_POINTS
from service.lives.history import Event, moment_of
from service.queries import clutch_list
from storage import clutches, diagnoses
from storage.diagnoses import NewDiagnosis
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.support import stationary

AT = "2026-11-02T10:00:00+00:00"


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


@pytest.mark.parametrize("count", [1, MOST_LINE_POINTS, MOST_LINE_POINTS + 1, 1000])
def test_a_line_is_short_and_ends_with_the_last_value(count: int) -> None:
    series = SimpleNamespace(measurements=[SimpleNamespace(value=float(index)) for index in range(count)])
    events = [Event(run_id="a", kind="maintenance", cycles=5.0, moment=10.0)]
    said = recent(events, series)["mean_cof"]  # type: ignore[arg-type]
    assert len(said) <= MOST_LINE_POINTS
    assert said[-1] == count - 1
    assert len({after - before for before, after in itertools.pairwise(said)}) <= 1


def test_without_a_measurement_there_is_no_line() -> None:
    events = [Event(run_id="a", kind="run_in", cycles=0.0, moment=0.0)]
    assert recent(events, SimpleNamespace(measurements=[]))["mean_cof"] == []  # type: ignore[arg-type]


@pytest.mark.parametrize("stored", ["0001-01-01T00:00:00+23:59", "9999-12-31T23:59:59-23:59"])
def test_a_time_that_an_earlier_release_stored_outside_of_all_dates_is_shown(stored: str) -> None:
    """Both are no date in UTC, in which the fleet shows when the last run was made."""
    events = [Event(run_id="a", kind="run_in", cycles=0.0, moment=moment_of(stored, ""))]
    said = recent(events, SimpleNamespace(measurements=[]))["last_run"]["at"]  # type: ignore[arg-type]
    assert said[:4] == stored[:4]


def test_a_summary_of_an_earlier_release_tells_the_life_all_the_same(client: TestClient, database_url: str) -> None:
    """Summaries did not name the present life: it is looked up where a diagnosis is known."""
    database = open_database(database_url)
    with database.writing() as connection:
        new = NewDiagnosis(
            clutch_id="c1",
            diagnosis_id="d1",
            created_at=AT,
            revision=0,
            last_run_key=0,
            life="",
            as_of_cycles=None,
            code_version="0",
        )
        diagnoses.insert(connection, new)
        diagnoses.finish(connection, "d1", AT, {"verdict": "cause_named", "causes": ["oil_change"]}, None)
    for body in (stationary(0), {"kind": "maintenance", "cycles": 10, "event": "oil_change"}):
        client.post("/v1/clutches/c1/runs", json=body)
    assert _forgotten(client, database) == {False}
    client.post("/v1/clutches/c1/runs", json={"kind": "maintenance", "cycles": 20, "event": "rebuild"})
    assert _forgotten(client, database) == {True}
    database.close()


def _forgotten(client: TestClient, database: Database) -> set[bool]:
    """Whether the diagnosis is of an earlier life: by the summary as it is, and without what it says of the life."""
    said = {client.get("/v1/clutches/c1").json()["diagnosis"]["earlier_life"]}
    with database.writing() as connection:
        row = clutches.get(connection, "c1")
        assert row is not None
        assert "life" in row.summary
        old = {name: value for name, value in row.summary.items() if name != "life"}
        clutches.set_summary(connection, "c1", row.rank, old, life="", state=row.state, if_disputed=row.state)
    return said | {client.get("/v1/clutches").json()["items"][0]["diagnosis"]["earlier_life"]}


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
