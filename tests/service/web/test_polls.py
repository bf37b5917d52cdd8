"""What was asked before is answered before routing: only to who may read, and only what the clutch's revision still says."""

from functools import partial
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import quote

import pytest
from fastapi import Request
from fastapi.testclient import TestClient
from httpx2 import Client

from service.web import auth
from service.web.context import Context
from service.web.middleware import Polls
from storage import keys
from storage.engine.errors import DatabaseBusy
from tests.service.web.test_connections import resident
from tests.support import one_quick, serving, stationary

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
    run = stationary(cycles, pressures=(5.0,))
    assert client.post("/v1/clutches/c1/runs", json=run).status_code == 201


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


def test_a_number_is_one_entry_however_it_is_written(polled: TestClient) -> None:
    """3,000 spellings of one number added 142 MiB outside every bound."""
    address = "/v1/clutches/c1/remaining-useful-life"
    assert polled.get(f"{address}?at_cycles=0&method=particle").status_code == 200
    index = polls_of(polled)
    entries = len(index._polls)
    routed(polled)
    answers = set()
    for spelled in ("0", "0.0", "0e9", "-0", "+0", "00", "0.000000000000000000000000", " 0"):
        for query in (f"at_cycles={quote(spelled)}", f"method=particle&at_cycles={quote(spelled)}"):
            answers.add(polled.get(f"{address}?{query}").content)
    assert len(answers) == 1
    assert (len(index._polls), routed(polled)) == (entries, [])


@pytest.mark.parametrize(
    "argument",
    ["remaining-useful-life?at_cycles=", "remaining-useful-life?pressure_bar=", "runs?limit=", "scores?limit="],
)
def test_what_cannot_be_a_number_is_refused_by_its_length(polled: TestClient, argument: str) -> None:
    answer = polled.get(f"/v1/clutches/c1/{argument}{'0' * 40}1")
    assert answer.status_code == 422
    assert "at most 32 characters" in answer.json()["detail"]


@pytest.mark.slow
def test_many_spellings_take_no_memory(tmp_path: Path) -> None:
    """40 MB each of numbers, names and keys, of which one entry each was kept."""
    with serving(tmp_path / "a.db", loaded=True) as server, Client(base_url=server.url, timeout=60) as http:
        assert http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        assert http.post("/v1/clutches/c1/runs", json=stationary(1000.0)).status_code == 201
        ask = partial(http.get, "/v1/clutches/c1/remaining-useful-life")
        for _ in range(50):
            assert ask().status_code == 200
        before = resident(server.pid)
        for number in range(1000):
            assert ask(params={"at_cycles": f"1000.{'0' * (40_000 + number)}"}).status_code == 422
            assert http.get(f"/v1/clutches/{'c' * 40_000}{number}").status_code == 404
            assert ask(headers={"Authorization": f"Bearer{' ' * 40_000}{number}"}).status_code == 200
        assert resident(server.pid) - before < 24 << 20


def polls_of(client: TestClient) -> Polls:
    """The index in the application's stack of middleware."""
    layer: Any = client.app.middleware_stack  # type: ignore[attr-defined]
    while not isinstance(layer, Polls):
        layer = layer.app
    return layer


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

    monkeypatch.setattr("storage.engine.sqlite.database.FileWatch.snapshots", unreadable)
    answer = polled.get("/v1/clutches/c1/runs")
    assert (answer.status_code, answer.headers["Retry-After"]) == (503, "1")


@pytest.mark.parametrize("table", one_quick(["runs", "changes", "series", "loops", "degradation", "scores"]))
def test_a_page_that_was_asked_for_is_not_the_answer_for_another(client: TestClient, table: str) -> None:
    for cycles in (0.0, 1000.0, 2000.0):
        post(client, cycles)
    address = f"/v1/clutches/c1/{table}"
    assert client.get(address).status_code == 200
    pages = {limit: client.get(f"{address}?limit={limit}").json()["items"] for limit in (1, 2, 1)}
    assert all(len(items) <= limit for limit, items in pages.items())
    if table in ("runs", "series", "degradation"):
        assert [len(items) for items in pages.values()] == [1, 2]
    assert client.get(f"{address}?cursor=bad").status_code == 422
