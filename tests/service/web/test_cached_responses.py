"""Answers that are kept by the clutch's revision: computed once, and never given when they no longer hold."""

import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.queries import series
from service.web import answers
from service.workflows.replay import replay_clutch
from storage.engine.opening import open_database
from storage.engine.sqlite.database import back_up
from tests.service.clients import client_on
from tests.support import stationary

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
        return told_on(f"sqlite:///{folder}/copy.db")


def told_on(database_url: str) -> dict[str, tuple[str, bytes]]:
    with client_on(database_url) as client:
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


def test_an_unknown_clutch_is_unknown_however_often_it_is_asked_for(client: TestClient) -> None:
    for name in ASKED:
        assert [client.get(f"/v1/clutches/nobody/{name}").status_code for _ in range(2)] == [404, 404]


def test_of_an_unknown_clutch_nothing_is_taken_over_from_another_service(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def kept(_database: object, query: Callable[..., object], clutch_id: str) -> tuple[int, bytes]:
        asked.append((query.__name__, clutch_id))
        return 0, b'{"items":[]}'

    monkeypatch.setattr(answers, "shared_answer", kept)
    assert client.get("/v1/clutches/nobody/degradation").status_code == 404
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
    made, ready = answers.revision_and_json, threading.Event()

    def slowly(*arguments: Any) -> tuple[int, bytes]:
        ready.wait(20)
        return made(*arguments)

    monkeypatch.setattr(answers, "revision_and_json", slowly)
    monkeypatch.setattr(answers, "WAIT_SECONDS", 0.2)
    given = client.get(f"{BASE}/degradation")
    assert not ready.is_set()
    assert (given.headers["ETag"], given.content) == (before.headers["ETag"], before.content)
    assert given.headers["Clutchlife-Revision"] == before.headers["Clutchlife-Revision"]
    ready.set()
    newest = client.get(f"{BASE}/degradation", headers={"Prefer": "wait=60"})
    assert int(newest.headers["Clutchlife-Revision"]) > int(before.headers["Clutchlife-Revision"])
