"""What was asked before is answered before routing: only to who may read, and only what the clutch's revision still says."""

from typing import NoReturn

import pytest
from fastapi import Request
from fastapi.testclient import TestClient

from service.web import auth
from service.web.context import Context
from storage import keys
from storage.engine.errors import DatabaseBusy
from tests.support import stationary

POLLED = (
    "/v1/clutches", "/v1/clutches/c1/remaining-useful-life", "/v1/clutches/c1/degradation", "/v1/clutches/c1/runs",
    "/v1/clutches/c1/runs?limit=1", "/v1/clutches/c1/series",
)  # fmt: skip
AT = "2026-11-02T10:00:00Z"


@pytest.fixture
def polled(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> TestClient:
    """A service where a run was posted and everything asked once; from then on nothing is routed unseen."""
    post(client, 0.0)
    for address in POLLED:
        assert client.get(address).status_code == 200
    routed: list[str] = []
    unknown_arguments = auth._refuse_unknown_arguments

    def noted(request: Request) -> None:
        routed.append(request.url.path)
        unknown_arguments(request)

    monkeypatch.setattr(auth, "_refuse_unknown_arguments", noted)
    client.app.state.routed = routed  # type: ignore[attr-defined]
    return client


def routed(client: TestClient) -> list[str]:
    """The addresses that were routed since this was asked for last."""
    found: list[str] = client.app.state.routed  # type: ignore[attr-defined]
    taken = list(found)
    found.clear()
    return taken


def post(client: TestClient, cycles: float) -> None:
    assert client.post("/v1/clutches/c1/runs", json=stationary(cycles)).status_code == 201


@pytest.mark.parametrize("address", POLLED)
def test_the_same_again_is_the_same_answer_or_304(polled: TestClient, address: str) -> None:
    first = polled.get(address)
    assert first.status_code == 200
    assert polled.get(address).content == first.content
    seen = polled.get(address, headers={"If-None-Match": first.headers["ETag"]})
    assert (seen.status_code, seen.content, seen.headers["ETag"]) == (304, b"", first.headers["ETag"])
    assert "Content-Security-Policy" in seen.headers
    assert polled.head(address).headers["ETag"] == first.headers["ETag"]
    assert routed(polled) == []


@pytest.mark.parametrize("address", POLLED)
def test_a_changed_clutch_is_looked_at_anew(polled: TestClient, address: str) -> None:
    before = polled.get(address)
    post(polled, 1000.0)
    routed(polled)
    after = polled.get(address, headers={"If-None-Match": before.headers["ETag"]})
    assert after.status_code == 200
    assert after.headers["ETag"] != before.headers["ETag"]
    assert len(routed(polled)) == 1


def test_nobody_is_answered_who_may_not_read(polled: TestClient) -> None:
    context = polled.app.state.context  # type: ignore[attr-defined]
    assert isinstance(context, Context)
    text, row = auth.make_key("read", "page", created_at=AT)
    with context.database.writing() as connection:
        keys.insert(connection, row)
    for address in POLLED:
        assert polled.get(address).status_code == 401
        assert polled.get(address, headers={"Authorization": "Bearer nobody"}).status_code == 401
        assert polled.get(address, headers={"Authorization": f"Bearer {text}"}).status_code == 200
    with context.database.writing() as connection:
        keys.revoke(connection, row.key_id, AT)
        keys.insert(connection, auth.make_key("read", "another", created_at=AT)[1])
    for address in POLLED:
        assert polled.get(address, headers={"Authorization": f"Bearer {text}"}).status_code == 401


def test_other_arguments_are_another_address(polled: TestClient) -> None:
    assert polled.get("/v1/clutches/c1/runs?limits=1").status_code == 422
    assert polled.get("/v1/clutches/c1/runs?limit=0").status_code == 422
    assert polled.get("/v1/clutches/other/runs").status_code == 404


def test_requests_are_counted_by_their_routes_either_way(polled: TestClient) -> None:
    def counted() -> float:
        line = 'clutchlife_requests_total{method="GET",route="/v1/clutches/{clutch_id}/runs",status="200"} '
        text = polled.get("/metrics").text
        return float(text.partition(line)[2].partition("\n")[0])

    before = counted()
    assert polled.get("/v1/clutches/c1/runs").status_code == 200
    assert counted() == before + 1


def test_a_database_that_cannot_be_read_is_said_to_be(polled: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreadable(*_: object) -> NoReturn:
        raise DatabaseBusy("locked")

    monkeypatch.setattr("storage.engine.sqlite.watch.FileWatch.glances", unreadable)
    answer = polled.get("/v1/clutches/c1/runs")
    assert (answer.status_code, answer.headers["Retry-After"]) == (503, "1")
