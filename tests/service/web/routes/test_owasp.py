"""What an attacker would try first, by the OWASP API Security Top 10 of 2023; of keys test_scopes.py, of shares
test_shares.py, of fields that are the service's own test_bad_input.py, of what goes out test_openapi.py."""

import csv
import re
from dataclasses import replace

import pytest
from fastapi.testclient import TestClient

from storage import diagnoses
from tests.architecture.source import ROOT
from tests.service.web.routes.granting import context_of, granted
from tests.storage.samples import new_diagnosis
from tests.support import stationary

CLUTCHES = "/v1/clutches"


def test_api1_an_object_of_others_cannot_be_reached_through_an_own_one(client: TestClient) -> None:
    """The names of a run, of an inspection and of a diagnosis lead to them below their own clutch only."""
    runs, inspections = f"{CLUTCHES}/c1/runs", f"{CLUTCHES}/c1/inspections"
    assert client.post(runs, json=stationary(0.0, run_id="a")).status_code == 201
    inspection = client.post(inspections, json={"cycles": 0, "note": "as new"}).json()["inspection_id"]
    with context_of(client).database.writing() as connection:
        diagnoses.insert(connection, replace(new_diagnosis(0), clutch_id="c1", diagnosis_id="d1"))
        assert diagnoses.finish(connection, "d1", "2026-11-02", {"verdict": "model_adequate"}, {})
    bound = granted(client, "admin", clutches=["mine"])
    client.post(CLUTCHES, json={"clutch_id": "mine"}, headers=bound)
    reason = {"reason": "x"}
    tries = [
        ("GET", "runs/a", None),
        ("PATCH", "runs/a", {"cycles": 1, **reason}),
        *[("POST", f"runs/a/{change}", reason) for change in ("withdraw", "restore", "confirm")],
        ("GET", "diagnoses/d1", None),
        ("PUT", "model", {"diagnosis_id": "d1"}),
        ("GET", f"inspections/{inspection}", None),
        *[("POST", f"inspections/{inspection}/{change}", reason) for change in ("withdraw", "restore")],
    ]
    whole = granted(client, "admin")
    for method, path, body in tries:
        answer = client.request(method, f"{CLUTCHES}/mine/{path}", json=body, headers=bound)
        assert answer.status_code == 404, (method, path, answer.json())
        if method == "GET":
            assert client.get(f"{CLUTCHES}/c1/{path}", headers=whole).status_code == 200, "it is there"


#: What opens connections to others.
_CLIENTS = re.compile(
    # options of a socket open none
    r"^\s*(?:import|from) (httpx2|urllib\.request|http\.client|requests|aiohttp|socket)\b(?! import SO)",
    re.MULTILINE,
)


def test_api7_the_service_asks_no_address_that_it_is_sent_but_receivers_of_alarms() -> None:
    """No other part of it than the command line and the client can open a connection; its readers, whose warm process is
    spoken to through a pair of sockets, cannot even by force: test_sandbox.py. Which addresses receivers may have:
    tests/service/alarms/test_receivers.py."""
    sources = [path.relative_to(ROOT / "service") for path in (ROOT / "service").rglob("*.py")]
    assert len(sources) > 80
    opening = {path for path in sources if _CLIENTS.search((ROOT / "service" / path).read_text(encoding="utf-8"))}
    inside = {path.as_posix() for path in opening if path.parts[0] not in ("cli", "client")}
    assert inside == {"alarms/receivers.py", "readers/sandbox.py", "readers/zygote.py"}
    assert len(opening) > len(inside), "nothing would be found"


@pytest.mark.parametrize("path", ["/", "/clutches/c1", "/docs", "/docs/start.js", CLUTCHES, "/nowhere", "/livez"])
def test_api8_every_answer_has_the_headers_that_browsers_heed(shared_client: TestClient, path: str) -> None:
    """In a browser: tests/journeys/dashboard/test_files.py."""
    answer = shared_client.get(path, headers={"Origin": "http://127.0.0.1"})
    policy = dict(part.strip().split(" ", 1) for part in answer.headers["content-security-policy"].split(";"))
    assert (policy["script-src"], policy["frame-ancestors"], policy["object-src"]) == ("'self'", "'none'", "'none'")
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert not [name for name in answer.headers if name.startswith("access-control-")], "no other origin may read"
    if answer.headers["content-type"].startswith("text/html"):
        assert re.findall(r"<script(?![^>]*\bsrc=)|\son\w+=|javascript:", answer.text) == []
    assert "server" not in answer.headers


def test_api10_a_note_is_no_formula_in_a_spreadsheet(client: TestClient) -> None:
    """A rig's key must not have an engineer's spreadsheet compute, or ask, what it likes."""
    notes = ["as new", "=1+1", "@SUM(A1)", "+1", "-1+cmd"]
    for cycles, note in enumerate(notes):
        sent = {"cycles": cycles, "note": note, "roughness_um": 2.5, "skewness": -3.5}
        assert client.post(f"{CLUTCHES}/c1/inspections", json=sent).status_code == 201
    rows = list(csv.DictReader(client.get(f"{CLUTCHES}/c1/inspections.csv").text.splitlines()))
    assert [row["note"] for row in rows] == ["as new", *(f"'{note}" for note in notes[1:])]
    assert {row["skewness"] for row in rows} == {"-3.5"}, "numbers stay numbers"
    assert [item["note"] for item in client.get(f"{CLUTCHES}/c1/inspections").json()["items"]] == notes
