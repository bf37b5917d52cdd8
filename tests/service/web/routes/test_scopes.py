"""Who may do what: one table of the routes, and every key tried at every one of them; without keys, this machine alone,
under no other name than its own."""

import re
import socket
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.web.auth import SCOPES, Scope, is_loopback
from storage import jobs, keys
from storage.jobs import JobRow
from tests.service.clients import client_on
from tests.service.jobs.waiting import until
from tests.service.web.routes.granting import AT, context_of, granted, revoke_all
from tests.support import serving, stationary

CLUTCH = "/v1/clutches/{clutch_id}"
#: Routes that show nothing of a clutch: pages without data, the description, whether the service lives.
OPEN = [
    ("GET", path)
    for path in (
        "/", "/clutches/{clutch_id}", "/compare",
        "/assets/{digest}/{name:path}", "/livez", "/readyz", "/openapi.json", "/docs",
        "/docs/start.js", "/help", "/help/{name:path}", "/static-offline-docs",
    )
]  # fmt: skip
#: Routes that name no clutch and keep to those of the key.
NARROWED: dict[tuple[str, str], Scope] = {
    ("GET", "/v1/clutches"): "read",
    ("POST", "/v1/clutches"): "ingest",
    ("GET", "/v1/fleet/totals"): "read",
    ("POST", "/v1/import/preview"): "ingest",
    ("GET", "/v1/rigs"): "read",
    ("GET", "/v1/rigs/{name}"): "read",
    ("GET", "/v1/jobs"): "read",
    ("POST", "/v1/jobs"): "admin",
    ("GET", "/v1/jobs/{job_id}"): "read",
    ("DELETE", "/v1/jobs/{job_id}"): "admin",
    ("GET", "/v1/alarms"): "read",
    ("POST", "/v1/alarms"): "ingest",
    ("GET", "/v1/alarms/events"): "read",
    ("GET", "/v1/alarms/events/{event_id}"): "read",
    ("POST", "/v1/alarms/events/{event_id}/acknowledge"): "ingest",
    ("GET", "/v1/alarms/{alarm_id}"): "read",
    ("PUT", "/v1/alarms/{alarm_id}"): "admin",
    ("DELETE", "/v1/alarms/{alarm_id}"): "admin",
    ("POST", "/v1/alarms/{alarm_id}/test"): "admin",
}
#: Routes that are of all clutches together: a key that is bound to some has no place there.
OF_ALL: dict[tuple[str, str], Scope] = {
    ("GET", path): "read"
    for path in ("/metrics", "/v1/fleet/priors", "/v1/fleet/priors.csv", "/v1/fleet/scores", "/v1/fleet/scores.csv")
} | {
    ("POST", "/v1/rigs"): "ingest",
    ("PUT", "/v1/rigs/{name}"): "admin",
    ("GET", "/v1/webhooks"): "read",
    ("POST", "/v1/webhooks"): "admin",
    ("GET", "/v1/webhooks/{webhook_id}"): "read",
    ("DELETE", "/v1/webhooks/{webhook_id}"): "admin",
    ("GET", "/v1/webhooks/{webhook_id}/deliveries"): "read",
    ("POST", "/v1/webhooks/{webhook_id}/test"): "admin",
}
_READ = (
    "", "/changes", "/changes.csv", "/runs", "/runs.csv", "/runs/{run_id}", "/runs/{run_id}/file", "/remaining-useful-life",
    "/remaining-useful-life.csv", "/degradation", "/degradation.csv", "/stribeck", "/stribeck.csv", "/engagement",
    "/surfaces", "/surfaces.csv", "/scores", "/scores.csv", "/loops", "/loops.csv", "/series", "/series.csv", "/diagnoses",
    "/diagnoses/{diagnosis_id}",
    "/diagnoses/{diagnosis_id}/plan", "/diagnoses/{diagnosis_id}/plan.csv", "/model",
    "/inspections", "/inspections.csv", "/inspections/{inspection_id}",
    "/inspections/{inspection_id}/photographs/{photograph_id}",
)  # fmt: skip
OF_ONE: dict[tuple[str, str], Scope] = {("GET", f"{CLUTCH}{path}"): "read" for path in _READ}
OF_ONE |= {("POST", f"{CLUTCH}/remaining-useful-life/forecast"): "read"}
OF_ONE |= {("POST", f"{CLUTCH}/{path}"): "ingest" for path in ("runs", "runs/file", "diagnoses", "inspections")}
OF_ONE |= {("POST", f"{CLUTCH}/inspections/{{inspection_id}}/photographs"): "ingest"}
OF_ONE |= {("POST", f"{CLUTCH}/inspections/{{inspection_id}}/{change}"): "admin" for change in ("withdraw", "restore")}
OF_ONE |= {("POST", f"{CLUTCH}/doubts/{{doubt_id}}/answer"): "admin"}
OF_ONE |= {("POST", f"{CLUTCH}/runs/{change}"): "admin" for change in ("confirm", "correct", "withdraw", "restore")}
OF_ONE |= {("POST", f"{CLUTCH}/runs/{{run_id}}/{change}"): "admin" for change in ("withdraw", "restore", "confirm")}
OF_ONE |= {
    ("PATCH", CLUTCH): "admin",
    ("PATCH", f"{CLUTCH}/runs/{{run_id}}"): "admin",
    ("PUT", f"{CLUTCH}/model"): "admin",
}
TABLE = NARROWED | OF_ALL | OF_ONE


def ask(client: TestClient, route: tuple[str, str], headers: Mapping[str, str] | None, clutch_id: str = "c1") -> int:
    """The status; nothing is changed, for what is sent has no type."""
    method, path = route
    content = None if method == "GET" else b"nothing"
    return client.request(method, address_of(path, clutch_id), headers=headers, content=content).status_code


def address_of(path: str, clutch_id: str = "c1") -> str:
    return path.replace("{clutch_id}", clutch_id).replace("{run_id}", "r1").replace("{diagnosis_id}", "d1")


def routes_of(routes: Iterable[Any]) -> Iterator[tuple[str, str]]:
    """Method and path of every route as the application routes them, included routers too; HEAD goes with GET."""
    for route in routes:
        if (included := getattr(route, "original_router", None)) is not None:
            yield from routes_of(included.routes)
        else:
            yield from ((method, route.path) for method in (getattr(route, "methods", None) or {"GET"}) - {"HEAD"})


def test_every_route_of_the_application_is_in_the_table(client: TestClient) -> None:
    """A new route fails here until it is said who may use it."""
    found = set(routes_of(client.app.routes))  # type: ignore[attr-defined]
    assert len(found) > 40, "the routes were not found"
    assert found == set(OPEN) | set(TABLE)


@pytest.fixture
def headers(client: TestClient) -> dict[Scope, Mapping[str, str]]:
    """A key of each scope."""
    return {scope: granted(client, scope) for scope in SCOPES}


def test_a_key_opens_what_its_scope_holds_and_nothing_else(
    client: TestClient, headers: dict[Scope, Mapping[str, str]]
) -> None:
    wrong = []
    for route, needed in TABLE.items():
        assert ask(client, route, None) == 401, route
        for scope in SCOPES:
            refused = ask(client, route, headers[scope]) in (401, 403)
            if refused != (SCOPES.index(scope) < SCOPES.index(needed)):
                wrong.append((route, scope, refused))
    assert wrong == []


def test_a_key_bound_to_one_clutch_is_refused_at_every_other(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    whole, bound = granted(client, "read"), granted(client, "admin", clutches=["c2"])
    for path in ("/v1/clutches", "/v1/clutches/c1/remaining-useful-life") * 2:
        assert client.get(path, headers=whole).status_code == 200  # what was polled with it is not given to the other
    assert [route for route in OF_ONE if ask(client, route, bound, "c1") != 403] == []
    assert [route for route in OF_ONE if ask(client, route, bound, "unknown") != 403] == [], "names are not found out"
    assert [route for route in OF_ALL if ask(client, route, bound) != 403] == []
    assert [route for route in OF_ONE if ask(client, route, bound, "c2") in (401, 403)] == []
    assert [item["clutch_id"] for item in client.get("/v1/clutches", headers=bound).json()["items"]] == ["c2"]
    assert client.get("/v1/clutches?limit=1", headers=bound).json()["next"] is None
    assert client.post("/v1/clutches", json={"clutch_id": "c3"}, headers=bound).status_code == 403
    assert client.post("/v1/clutches", json={"clutch_id": "c2"}, headers=bound).status_code == 200


def test_a_key_expires_and_its_last_use_is_noted(client: TestClient) -> None:
    used, past, unused = (granted(client, "read", days=days) for days in (1, 0, 1))
    before = datetime.now(UTC).isoformat(timespec="seconds")
    assert client.get("/v1/clutches", headers=used).status_code == 200
    answer = client.get("/v1/clutches", headers=past)
    assert (answer.status_code, "expired" in answer.json()["detail"]) == (401, True)

    def noted(headers: Mapping[str, str]) -> str | None:
        with context_of(client).database.reading() as connection:
            rows = {row.key_id: row.last_used_at for row in keys.all_keys(connection)}
        return rows[headers["Authorization"].split("_")[1]]

    assert (until(lambda: noted(used)) or "") >= before
    assert noted(unused) is noted(past) is None


def test_an_ingest_key_has_a_diagnosis_made_and_not_adopted(client: TestClient) -> None:
    headers = granted(client, "ingest")
    assert client.post("/v1/clutches/c1/runs", json=stationary(0.0), headers=headers).status_code == 201
    adopted = client.post("/v1/clutches/c1/diagnoses", json={"adopt": True}, headers=headers)
    assert (adopted.status_code, "admin" in adopted.json()["detail"]) == (403, True)
    assert client.get("/v1/clutches/c1/diagnoses", headers=headers).json()["items"] == []


def test_a_key_bound_to_one_clutch_sees_and_cancels_jobs_of_that_alone(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    arguments = {"last_run_key": 0, "adopt_by": None, "request": ""}
    with context_of(client).database.writing() as connection:
        for clutch_id in ("c1", "c2", None):
            of = {"job_id": f"j-{clutch_id}", "kind": jobs.DIAGNOSIS, "clutch_id": clutch_id, "arguments": arguments}
            jobs.insert(connection, JobRow(asked_at=AT, asked_by="local", **of))
            jobs.end(connection, f"j-{clutch_id}", jobs.FINISHED, AT)
    bound = granted(client, "admin", clutches=["c2"])
    assert [item["job_id"] for item in client.get("/v1/jobs", headers=bound).json()["items"]] == ["j-c2"]
    for method in ("GET", "DELETE"):
        for name, status in (("c1", 404), ("c2", 200), (None, 404)):
            assert client.request(method, f"/v1/jobs/j-{name}", headers=bound).status_code == status
    assert len(client.get("/v1/jobs", headers=granted(client, "read")).json()["items"]) == 3


def test_every_route_that_can_be_read_can_be_headed(client: TestClient) -> None:
    """All but when and which request it was; of what changes with every request, all but its length."""
    client.post("/v1/clutches/c1/runs", json=stationary(0, run_id="r1"))
    (asset,) = set(re.findall(r'"[^"]*?(assets/[^"]*/clutch\.js)"', client.get("/clutches/c1").text))
    wrong = []
    for path in [path for method, path in (*OPEN, *TABLE) if method == "GET"]:
        address = f"/{asset}" if path.startswith("/assets/") else address_of(path)
        there, head = client.get(address), client.head(address)
        differ = {name for name, _ in there.headers.items() ^ head.headers.items()}
        ignored = {"date", "x-request-id"} | ({"content-length"} if path == "/metrics" else set())
        if (head.status_code, head.content) != (there.status_code, b"") or not differ <= ignored:
            wrong.append((address, there.status_code, head.status_code, differ))
    assert wrong == []


def test_without_keys_this_machine_alone_is_answered_by_its_own_names(client: TestClient) -> None:
    """A page in a browser could have made a name of its own point here."""
    for host in ("127.0.0.1", "127.0.0.1:8000", "localhost", "LOCALHOST:80", "[::1]:8000", "localhost."):
        assert client.get("/v1/clutches", headers={"Host": host}).status_code == 200, host
    for host in ("rig.example", "127.0.0.1.rig.example", "10.0.0.5:8000", "[fe80::1]", "", "localhost@evil"):
        answer = client.get("/v1/clutches", headers={"Host": host})
        assert (answer.status_code, answer.headers["content-type"]) == (403, "application/problem+json"), host
    elsewhere = TestClient(client.app, base_url="http://127.0.0.1", client=("192.0.2.7", 50000))
    assert elsewhere.get("/v1/clutches").status_code == 403
    assert elsewhere.get("/livez").status_code == 200
    assert all(is_loopback(name) for name in ("127.8.9.1", "::1", "localhost"))
    assert not any(is_loopback(name) for name in ("192.0.2.1", "example", "", "::"))


def test_after_the_last_key_is_revoked_the_service_stays_shut(client: TestClient) -> None:
    assert client.get("/v1/clutches").status_code == 200
    headers = granted(client, "admin")
    assert [client.get("/v1/clutches", headers=said).status_code for said in ({}, headers)] == [401, 200]
    revoke_all(client)
    assert [client.get("/v1/clutches", headers=said).status_code for said in ({}, headers)] == [401, 401]


PROXIED = ["Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Forwarded-Proto", "X-Real-IP"]
PROXIED += ["Fastly-Client-IP", "X-Original-Forwarded-For", "X-Envoy-External-Address", "CDN-Loop"]


@pytest.mark.parametrize("header", PROXIED)
def test_what_a_proxy_passes_on_is_refused_without_keys(client: TestClient, header: str) -> None:
    """It comes from this machine and may be anybody's."""
    answer = client.get("/v1/clutches", headers={header: "127.0.0.1"})
    assert (answer.status_code, header.lower() in answer.json()["detail"].lower()) == (403, True)
    assert client.get("/livez", headers={header: "127.0.0.1"}).status_code == 200


@pytest.mark.parametrize(("version", "status"), [("1.0", b"403"), ("1.1", b"200")])
def test_a_proxy_that_adds_no_header_is_known_by_its_version(tmp_path: Path, version: str, status: bytes) -> None:
    """nginx as it is installed: it asks in HTTP/1.0, under the name of this machine."""
    with serving(tmp_path / "a.db", loaded=True) as server:
        asked = f"GET /v1/clutches HTTP/{version}\r\nHost: 127.0.0.1:{server.port}\r\nConnection: close\r\n\r\n"
        with socket.create_connection(("127.0.0.1", server.port), timeout=30) as line:
            line.sendall(asked.encode())
            assert line.recv(12).partition(b" ")[2] == status


def test_insecure_local_answers_what_a_proxy_passes_on(database_url: str) -> None:
    with client_on(database_url, insecure_local=True) as client:
        assert client.get("/v1/clutches", headers={"X-Forwarded-For": "192.0.2.7"}).status_code == 200
        assert client.get("/v1/clutches", headers={"Host": "rig.example"}).status_code == 403
        elsewhere = TestClient(client.app, base_url="http://127.0.0.1", client=("192.0.2.7", 50000))
        assert elsewhere.get("/v1/clutches").status_code == 200


def test_a_key_is_long_and_kept_as_a_hash(client: TestClient) -> None:
    headers = granted(client)
    secret = headers["Authorization"].removeprefix("Bearer ")
    assert len(secret.rpartition("_")[2]) >= 43 or len(secret) >= 60, "256 bits"
    database = context_of(client).database
    files = [path for path in database.path.parent.iterdir() if path.is_file()]
    assert all(secret.encode() not in path.read_bytes() for path in files)
    assert any(b"secret_sha256" in path.read_bytes() for path in files), "the files were not looked at"
    assert client.get(f"/v1/clutches?key={secret}").status_code == 401, "a key in an address ends in logs"
