"""Who may do what: one table of the routes, and every key tried at every one of them."""

from collections.abc import Mapping
from datetime import UTC, datetime

import pytest
from fastapi.testclient import TestClient

from service.web.auth import SCOPES, Scope
from storage import jobs, keys
from storage.jobs import NewJob
from tests.service.web.routes.granting import AT, context_of, granted
from tests.service.web.routes.routes_of import routes_of
from tests.support import stationary

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
OF_ONE[("POST", f"{CLUTCH}/runs/confirm")] = "admin"
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
    address = path.replace("{clutch_id}", clutch_id).replace("{run_id}", "r1").replace("{diagnosis_id}", "d1")
    return client.request(method, address, headers=headers, content=None if method == "GET" else b"nothing").status_code


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
    bound = granted(client, "admin", clutches=["c2"])
    assert [route for route in OF_ONE if ask(client, route, bound, "c1") != 403] == []
    assert [route for route in OF_ONE if ask(client, route, bound, "unknown") != 403] == [], "names are not found out"
    assert [route for route in OF_ALL if ask(client, route, bound) != 403] == []
    assert [route for route in OF_ONE if ask(client, route, bound, "c2") in (401, 403)] == []
    assert [item["clutch_id"] for item in client.get("/v1/clutches", headers=bound).json()["items"]] == ["c2"]
    assert client.get("/v1/clutches?limit=1", headers=bound).json()["next"] is None
    assert client.post("/v1/clutches", json={"clutch_id": "c3"}, headers=bound).status_code == 403
    assert client.post("/v1/clutches", json={"clutch_id": "c2"}, headers=bound).status_code == 200


def test_what_was_polled_with_another_key_is_not_given_to_a_bound_one(client: TestClient) -> None:
    whole, bound = granted(client, "read"), granted(client, "read", clutches=["c2"])
    for path in ("/v1/clutches", "/v1/clutches/c1/remaining-useful-life"):
        for _ in range(2):
            assert client.get(path, headers=whole).status_code == 200
    assert client.get("/v1/clutches", headers=bound).json()["items"] == []
    assert client.get("/v1/clutches/c1/remaining-useful-life", headers=bound).status_code == 403


def test_a_key_expires(client: TestClient) -> None:
    soon, past = granted(client, "read", days=1), granted(client, "read", days=0)
    assert client.get("/v1/clutches", headers=soon).status_code == 200
    answer = client.get("/v1/clutches", headers=past)
    assert (answer.status_code, "expired" in answer.json()["detail"]) == (401, True)


def test_the_last_use_of_a_key_is_noted(client: TestClient) -> None:
    used, unused = granted(client, "read"), granted(client, "read")
    before = datetime.now(UTC).isoformat(timespec="seconds")
    assert client.get("/v1/clutches", headers=used).status_code == 200
    client.get("/readyz")
    context = context_of(client)
    names = [headers["Authorization"].split("_")[1] for headers in (used, unused)]
    for _ in range(200):
        with context.database.reading() as connection:
            noted = {row.key_id: row.last_used_at for row in keys.all_keys(connection)}
        if noted[names[0]] is not None:
            break
        client.get("/livez")
    assert noted[names[0]] >= before
    assert noted[names[1]] is None


def test_an_ingest_key_has_a_diagnosis_made_and_not_adopted(client: TestClient) -> None:
    headers = granted(client, "ingest")
    assert client.post("/v1/clutches/c1/runs", json=stationary(0.0), headers=headers).status_code == 201
    adopted = client.post("/v1/clutches/c1/diagnoses", json={"adopt": True}, headers=headers)
    assert (adopted.status_code, "admin" in adopted.json()["detail"]) == (403, True)
    assert client.get("/v1/clutches/c1/diagnoses", headers=headers).json()["items"] == []


def test_a_key_bound_to_one_clutch_sees_and_cancels_jobs_of_that_alone(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    with context_of(client).database.writing() as connection:
        for clutch_id in ("c1", "c2", None):
            job = NewJob(
                job_id=f"j-{clutch_id}", kind=jobs.DIAGNOSIS, clutch_id=clutch_id, asked_at=AT, asked_by="local",
                arguments={"last_run_key": 0, "adopt_by": None, "request": ""},
            )  # fmt: skip
            jobs.insert(connection, job)
            jobs.end(connection, job.job_id, jobs.FINISHED, AT)
    bound = granted(client, "admin", clutches=["c2"])
    assert [item["job_id"] for item in client.get("/v1/jobs", headers=bound).json()["items"]] == ["j-c2"]
    for method in ("GET", "DELETE"):
        statuses = [
            client.request(method, f"/v1/jobs/j-{name}", headers=bound).status_code for name in ("c1", "c2", None)
        ]
        assert statuses == [404, 200, 404]
    assert len(client.get("/v1/jobs", headers=granted(client, "read")).json()["items"]) == 3
