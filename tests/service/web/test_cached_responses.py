"""Answers that are kept: by the clutch's revision, computed once; and polls answered before routing."""

import tempfile
import threading
from collections.abc import Callable, Hashable
from functools import partial
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import quote

import pytest
from fastapi import Request
from fastapi.testclient import TestClient
from httpx2 import Client

from service.answers import series, store
from service.web import auth, responses
from storage.engine.errors import DatabaseBusy
from storage.engine.opening import open_database
from storage.engine.sqlite.database import back_up
from tests.lab.benchmarks.memory import resident
from tests.service.clients import client_on
from tests.service.jobs.replaying import replay_clutch
from tests.service.web.routes.granting import granted, revoke_all
from tests.support import serving, stationary

# --- Answers that are kept by the clutch's revision: computed once, and never given when they no longer hold.

BASE = "/v1/clutches/c1"
ASKED = (
    "series", "series.csv", "series?quantity=mean_cof", "series?limit=3", "degradation", "degradation?limit=2", "stribeck",
    "stribeck?limit=1", "surfaces", "loops", "runs", "runs?limit=2",
)  # fmt: skip


def told(client: TestClient) -> dict[str, tuple[str, bytes]]:
    """Entity tag and body of every remembered answer."""
    found = {}
    for name in ASKED:
        answer = client.get(f"{BASE}/{name}")
        assert answer.status_code == 200, answer.text
        found[name] = answer.headers["ETag"], answer.content
    return found


def told_by_another(database_url: str) -> dict[str, tuple[str, bytes]]:
    """The same by a service that remembers nothing yet, on a copy: two services never share a database."""
    with tempfile.TemporaryDirectory() as folder:
        back_up(database_url, Path(folder) / "copy.db")
        with client_on(f"sqlite:///{folder}/copy.db") as client:
            return told(client)


def post(client: TestClient, cycles: float) -> None:
    body = stationary(cycles, run_id=f"r{cycles:g}", pressures=(4.0, 6.0))
    assert client.post(f"{BASE}/runs", json=body).status_code == 201


def test_what_is_remembered_is_what_would_be_told_anew(client: TestClient, database_url: str) -> None:
    def rebuilt() -> None:
        body = {"kind": "maintenance", "cycles": 2500, "event": "rebuild", "run_id": "new"}
        assert client.post(f"{BASE}/runs", json=body).status_code == 201
        post(client, 3000.0)

    for cycles in (1000.0, 2000.0):
        post(client, cycles)
    before = told(client)
    assert told(client) == before
    # a test that comes late and becomes the reference, a rebuild and a test after it: each changes what is told
    for change in (lambda: post(client, 0.0), rebuilt):
        change()
        after = told(client)
        assert after == told_by_another(database_url)
        assert after["series"] != before["series"]
        assert after["degradation"][0] != before["degradation"][0]
        before = after


def test_a_replay_by_another_process_that_changes_nothing_keeps_the_tags(client: TestClient, database_url: str) -> None:
    for cycles in (0.0, 1000.0, 2000.0):
        post(client, cycles)
    before = told(client)
    with_others = open_database(database_url)
    replay_clutch(with_others, "c1")
    with_others.close()
    assert told(client) == before == told_by_another(database_url)


def test_nothing_is_made_twice_for_one_revision(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    ours = series.series
    monkeypatch.setattr(series, "series", lambda *given: made.append(given) or ours(*given))
    post(client, 0.0)
    first = client.get(f"{BASE}/series")
    again = client.get(f"{BASE}/series", headers={"If-None-Match": first.headers["ETag"]})
    assert (again.status_code, again.content, len(made)) == (304, b"", 1)
    assert client.get(f"{BASE}/series?quantity=health").content != first.content
    assert len(made) == 2
    post(client, 1000.0)
    assert client.get(f"{BASE}/series", headers={"If-None-Match": first.headers["ETag"]}).status_code == 200
    assert len(made) == 3


def test_an_unknown_clutch_is_unknown_however_often_it_is_asked_for_and_whatever_another_service_has_kept(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def kept(self: store.AnswerStore, key: Hashable, query: Callable[..., object], clutch_id: str) -> None:
        asked.append((query.__name__, clutch_id))
        self.begin(key, 0, b'{"items":[]}')

    monkeypatch.setattr(store.AnswerStore, "begin_shared", kept)
    for name in ASKED:
        assert [client.get(f"/v1/clutches/nobody/{name}").status_code for _ in range(2)] == [404, 404]
    assert asked == []
    post(client, 1000.0)
    assert client.get(f"{BASE}/surfaces").status_code == 200
    assert asked == [("surface", "c1")]


def test_idle_workers_on_a_busy_machine_are_waited_for_for_a_while(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other services may keep every processor busy: who asks is given the last answer, the newest once it is made."""
    post(client, 1000.0)
    before = client.get(f"{BASE}/degradation")
    post(client, 2000.0)
    made, ready = responses.revision_and_json, threading.Event()

    def slowly(*arguments: Any) -> tuple[int, bytes]:
        ready.wait(20)
        return made(*arguments)

    monkeypatch.setattr(responses, "revision_and_json", slowly)
    monkeypatch.setattr(responses, "WAIT_SECONDS", 0.2)
    given = client.get(f"{BASE}/degradation")
    assert not ready.is_set()
    assert (given.headers["ETag"], given.content) == (before.headers["ETag"], before.content)
    assert given.headers["Clutchlife-Revision"] == before.headers["Clutchlife-Revision"]
    ready.set()
    newest = client.get(f"{BASE}/degradation", headers={"Prefer": "wait=60"})
    assert int(newest.headers["Clutchlife-Revision"]) > int(before.headers["Clutchlife-Revision"])


# --- What was asked before is answered before routing: only to who may read, and only what the clutch's revision
# still says.

POLLED = (
    "/v1/clutches", "/v1/clutches/c1/remaining-useful-life", "/v1/clutches/c1/degradation", "/v1/clutches/c1/runs",
    "/v1/clutches/c1/runs?limit=1", "/v1/clutches/c1/series",
)  # fmt: skip


@pytest.fixture
def polled(client: TestClient) -> TestClient:
    """A service where a run was posted and everything asked once."""
    post(client, 0.0)
    for address in POLLED:
        assert client.get(address).status_code == 200
    return client


@pytest.fixture
def routed(polled: TestClient, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The addresses that are routed from then on."""
    assert polled
    seen: list[str] = []
    unknown_arguments = auth._refuse_unknown_arguments

    def noted(request: Request) -> None:
        seen.append(request.url.path)
        unknown_arguments(request)

    monkeypatch.setattr(auth, "_refuse_unknown_arguments", noted)
    return seen


def test_the_same_again_is_the_same_answer_or_304(polled: TestClient, routed: list[str]) -> None:
    for address in POLLED:
        first = polled.get(address)
        assert (first.status_code, polled.get(address).content) == (200, first.content)
        seen = polled.get(address, headers={"If-None-Match": first.headers["ETag"]})
        assert (seen.status_code, seen.content, seen.headers["ETag"]) == (304, b"", first.headers["ETag"])
        assert "Content-Security-Policy" in seen.headers
        assert polled.head(address).headers["ETag"] == first.headers["ETag"]
    assert routed == []
    line = 'clutchlife_requests_total{method="GET",route="/v1/clutches/{clutch_id}/runs",status="200"} '

    def counted() -> float:
        return float(polled.get("/metrics").text.partition(line)[2].partition("\n")[0])

    before = counted()
    assert polled.get("/v1/clutches/c1/runs").status_code == 200
    assert counted() == before + 1, "by its route either way"
    for other, status in (("c1/runs?limits=1", 422), ("c1/runs?limit=0", 422), ("other/runs", 404)):
        assert polled.get(f"/v1/clutches/{other}").status_code == status


def test_a_changed_clutch_is_looked_at_anew(polled: TestClient, routed: list[str]) -> None:
    before = {address: polled.get(address).headers["ETag"] for address in POLLED}
    post(polled, 1000.0)
    for address, tag in before.items():
        routed.clear()
        after = polled.get(address, headers={"If-None-Match": tag})
        assert after.status_code == 200
        assert after.headers["ETag"] != tag
        assert len(routed) == 1, address


def test_nobody_is_answered_who_may_not_read(polled: TestClient) -> None:
    key = granted(polled)
    for address in POLLED:
        assert polled.get(address).status_code == 401
        assert polled.get(address, headers={"Authorization": "Bearer nobody"}).status_code == 401
        assert polled.get(address, headers=key).status_code == 200
    revoke_all(polled)
    granted(polled)
    assert [polled.get(address, headers=key).status_code for address in POLLED] == [401] * len(POLLED)


def test_a_number_is_one_entry_however_it_is_written(polled: TestClient, routed: list[str]) -> None:
    """3,000 spellings of one number added 142 MiB outside every bound."""
    address = "/v1/clutches/c1/remaining-useful-life"
    assert polled.get(f"{address}?at_cycles=0&method=particle").status_code == 200
    index = polled.app.state.context.answers._asked  # type: ignore[attr-defined]
    entries = len(index)
    routed.clear()
    answers = set()
    for spelled in ("0", "0.0", "0e9", "-0", "+0", "00", "0.000000000000000000000000", " 0"):
        for query in (f"at_cycles={quote(spelled)}", f"method=particle&at_cycles={quote(spelled)}"):
            answers.add(polled.get(f"{address}?{query}").content)
    assert len(answers) == 1
    assert (len(index), routed) == (entries, [])


def test_what_cannot_be_a_number_is_refused_by_its_length(client: TestClient) -> None:
    life = "remaining-useful-life"
    for argument in (f"{life}?at_cycles", f"{life}?pressure_bar", "runs?limit", "scores?limit"):
        answer = client.get(f"/v1/clutches/c1/{argument}={'0' * 40}1")
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


def test_a_database_that_cannot_be_read_is_said_to_be(polled: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def unreadable(*_: object) -> NoReturn:
        raise DatabaseBusy("locked")

    monkeypatch.setattr("storage.engine.sqlite.database.FileWatch.snapshots", unreadable)
    answer = polled.get("/v1/clutches/c1/runs")
    assert (answer.status_code, answer.headers["Retry-After"]) == (503, "1")
