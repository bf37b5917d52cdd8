"""Runs and clutches changed over HTTP: who did it, entity tags, bodies that are refused."""

import pytest
from fastapi.testclient import TestClient

from service import repository
from service.clutch.plausibility.doubts import Judged
from service.web.auth import SCOPES
from tests.service.web.routes.granting import granted
from tests.support import stationary

BASE = "/v1/clutches/c1"
RUN = f"{BASE}/runs/a"


def post(client: TestClient, **headers: str) -> None:
    body = stationary(7000.0, run_id="a", pressures=(5.0,), speeds=(20, 120, 520, 1020, 1970))
    answer = client.post(f"{BASE}/runs", json=body, headers=headers)
    assert (answer.status_code, answer.json()["state"], answer.json()["sent_cycles"]) == (201, "accepted", 7000)


@pytest.fixture(autouse=True)
def _nothing_is_doubted(monkeypatch: pytest.MonkeyPatch) -> None:
    for change in ("ingest_run", "change_run"):
        monkeypatch.setattr(f"service.changes.{change}.doubts_together", lambda *_, **__: Judged())


def test_a_change_moves_the_tag_on_its_repeat_does_not_and_states_are_asked_for(client: TestClient) -> None:
    post(client)
    tags = []
    for _ in range(2):
        tags.append(client.get(f"{BASE}/runs").headers["etag"])
        answer = client.patch(RUN, json={"cycles": 700, "reason": "a zero too many"})
        assert (answer.status_code, answer.json()["cycles"]) == (200, 700)
    tags.append(client.get(f"{BASE}/runs").headers["etag"])
    assert tags[0] != tags[1] == tags[2]
    assert client.get(f"{BASE}/remaining-useful-life").json()["as_of_cycles"] == 700
    (entry,) = client.get(f"{BASE}/changes").json()["items"]
    assert entry | {"at": ""} == {
        "at": "", "by": "local", "action": "correct", "run_id": "a", "reason": "a zero too many",
        "before": {"state": "accepted", "cycles": 7000}, "after": {"state": "accepted", "cycles": 700},
    }  # fmt: skip
    assert client.get(RUN).json()["changes"] == [entry]
    for change, state in (("withdraw", "withdrawn"), ("restore", "accepted"), ("withdraw", "withdrawn")):
        assert client.post(f"{RUN}/{change}", json={"reason": "x"}).json()["state"] == state
    assert [len(client.get(f"{BASE}/runs?state={s}").json()["items"]) for s in ("accepted", "withdrawn")] == [0, 1]
    assert client.get(f"{BASE}/runs?state=lost").status_code == 422
    trail = client.get(f"{BASE}/changes").json()["items"]
    assert [each["action"] for each in trail] == ["withdraw", "restore", "withdraw", "correct"]
    lines = client.get(f"{BASE}/changes.csv").text.splitlines()
    assert (len(lines), lines[0]) == (5, "at,by,action,run_id,reason,before,after")
    assert client.get("/v1/clutches/c1").json()["runs"] == 0


def test_the_trail_names_the_key(client: TestClient) -> None:
    headers = {scope: granted(client, scope) for scope in SCOPES}
    named = {scope: f"key:{key['Authorization'].split('_')[1]} {scope}" for scope, key in headers.items()}
    post(client, **headers["ingest"])
    reason = {"reason": "a slip"}
    assert client.post(f"{RUN}/withdraw", json=reason).status_code == 401
    assert client.post(f"{RUN}/withdraw", json=reason, headers=headers["read"]).status_code == 403
    assert client.patch(BASE, json={"archived": True}, headers=headers["read"]).status_code == 403
    assert client.post(f"{RUN}/withdraw", json=reason, headers=headers["ingest"]).status_code == 403
    assert client.post(f"{RUN}/withdraw", json=reason, headers=headers["admin"]).status_code == 200
    (entry,) = client.get(f"{BASE}/changes", headers=headers["read"]).json()["items"]
    assert entry["by"] == named["admin"]
    (receipt,) = client.get(f"{BASE}/runs", headers=headers["read"]).json()["items"]
    assert receipt["received_by"] == client.get(RUN, headers=headers["read"]).json()["received_by"] == named["ingest"]


#: Method, address, body and status of changes that change nothing.
NO_CHANGES: tuple[tuple[str, str, dict[str, object], int], ...] = (
    ("POST", f"{RUN}/withdraw", {}, 422),
    ("POST", f"{RUN}/withdraw", {"reason": "  "}, 422),
    ("POST", f"{RUN}/withdraw", {"reason": "x" * 501}, 422),
    ("POST", f"{RUN}/withdraw", {"reason": "x", "cycles": 3}, 422),
    ("POST", f"{RUN}/restore", {}, 422),
    ("POST", f"{RUN}/confirm", {}, 200),
    ("POST", f"{BASE}/runs/confirm", {"run_ids": ["a"]}, 200),
    ("POST", f"{BASE}/runs/correct", {"cycles": {"a": 7000}, "reason": "another counter"}, 200),
    ("POST", f"{BASE}/runs/correct", {"cycles": {"a": -1}, "reason": "another counter"}, 422),
    ("POST", f"{BASE}/runs/correct", {"cycles": {"a": 700, "nobody": 800}, "reason": "another counter"}, 404),
    ("POST", f"{BASE}/doubts/counter-a/answer", {"accept": True}, 404),
    ("POST", f"{BASE}/doubts/counter-a/answer", {"accept": "yes"}, 422),
    ("POST", f"{BASE}/doubts/counter-a/answer", {}, 422),
    ("POST", f"{BASE}/runs/withdraw", {"run_ids": ["a", "nobody"], "reason": "another clutch's"}, 404),
    ("POST", f"{BASE}/runs/restore", {"run_ids": ["a"], "reason": "this clutch's"}, 200),
    ("POST", f"{BASE}/runs/restore", {"run_ids": ["a"]}, 422),
    ("POST", f"{BASE}/runs/confirm", {}, 422),
    ("POST", f"{BASE}/runs/confirm", {"run_ids": []}, 422),
    ("POST", f"{BASE}/runs/confirm", {"run_ids": ["a"] * 1001}, 422),
    ("POST", f"{BASE}/runs/confirm", {"run_ids": ["a", "nobody"]}, 404),
    ("PATCH", RUN, {"cycles": 3}, 422),
    ("PATCH", RUN, {"cycles": -3, "reason": "x"}, 422),
    ("PATCH", RUN, {"cycles": "3", "reason": "x"}, 422),
    ("PATCH", RUN, {"reason": "x"}, 422),
    ("POST", f"{BASE}/runs/nobody/withdraw", {"reason": "x"}, 404),
    ("PATCH", "/v1/clutches/nobody/runs/a", {"cycles": 3, "reason": "x"}, 404),
    ("PATCH", "/v1/clutches/nobody", {"archived": True}, 404),
    ("PATCH", BASE, {"fluid": "CVTF"}, 422),
    ("PATCH", BASE, {"fluid": None, "reason": "x"}, 422),
    ("PATCH", BASE, {"archived": None}, 422),
    ("PATCH", BASE, {"clutch_id": "c2", "reason": "x"}, 422),
    ("PATCH", BASE, {"revision": 1, "reason": "x"}, 422),
    ("PATCH", BASE, {"geometry": {"inner_diameter_mm": 200}, "reason": "x"}, 422),
    ("PATCH", BASE, {"reason": "nothing else"}, 200),
    ("PATCH", BASE, {}, 200),
)


def test_bodies_that_are_refused_change_nothing(client: TestClient) -> None:
    post(client)
    before = client.get(BASE).json()
    for method, address, body, status in NO_CHANGES:
        answer = client.request(method, address, json=body)
        assert answer.status_code == status, (method, address, body, answer.text)
        assert client.get(BASE).json() == before
    assert client.get(f"{BASE}/changes").json()["items"] == []


def test_an_archived_clutch_refuses_runs(client: TestClient) -> None:
    post(client)
    assert client.patch(BASE, json={"archived": True}).json()["archived"]
    answer = client.post(f"{BASE}/runs", json=stationary(8000.0))
    assert (answer.status_code, answer.json()["type"]) == (409, "urn:clutchlife:problem:archived")
    assert client.get("/v1/clutches").json()["items"] == []
    assert [item["clutch_id"] for item in client.get("/v1/clutches?archived=true").json()["items"]] == ["c1"]
    assert client.post(f"{RUN}/withdraw", json={"reason": "x"}).status_code == 200
    answer = client.patch(RUN, json={"cycles": 3, "reason": "x"})
    assert (answer.status_code, answer.json()["type"]) == (409, "urn:clutchlife:problem:not-possible-now")


def test_a_clutch_that_others_change_all_the_time_is_busy_and_not_computed_for_ever(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert client.post("/v1/clutches/c1/runs", json=stationary(0.0, run_id="r")).status_code == 201
    asked: list[int] = []
    monkeypatch.setattr(repository, "unchanged", lambda *_: asked.append(1))
    monkeypatch.setattr(repository, "MAX_ATTEMPTS", 3)
    for method, path, body in (
        ("POST", "/runs", stationary(1000.0)),
        ("POST", "/runs/r/withdraw", {"reason": "slipped"}),
        ("PATCH", "/runs/r", {"cycles": 50, "reason": "mistyped"}),
        ("PATCH", "", {"reason": "drawing", "end_of_life": {"cof_fraction": 0.4}}),
    ):
        asked.clear()
        answer = client.request(method, f"/v1/clutches/c1{path}", json=body)
        assert (answer.status_code, "Retry-After" in answer.headers, len(asked)) == (503, True, 3), path
        assert "was changed by other requests 3 times" in answer.json()["detail"]
