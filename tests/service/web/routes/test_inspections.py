"""What is found on a clutch's lining is stored beside its runs, listed by cycles, and withdrawn where it was a slip."""

import csv
import io
import json
import sqlite3
from contextlib import closing
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.changes import inspect_clutch
from tests.service.web.routes.granting import granted
from tests.service.web.routes.surfaces import FRESH, JPEG, WEBP, WORN, inspected, png, sha256
from tests.support import post_tests

BASE = "/v1/clutches/c1"
LIST = f"{BASE}/inspections"


def test_an_inspection_is_stored_as_it_was_sent_and_its_repeat_is_the_same_one(client: TestClient) -> None:
    address = inspected(client)
    stored = client.get(address).json()
    of_it = {"state": "accepted", "received_by": "local", "origin": "measured", "photographs": []}
    assert stored | WORN | of_it == stored
    again = client.post(LIST, json=WORN)
    assert (again.status_code, again.headers["location"]) == (200, address)
    assert again.json() == stored | {"duplicate": True}
    other = client.post(LIST, json=WORN | {"lining": "disc 2, side B"})
    assert other.status_code == 201
    assert len(client.get(LIST).json()["items"]) == 2


@pytest.mark.parametrize(
    ("body", "pointer"),
    [
        ({"cycles": 5}, ""),
        ({"cycles": 5, "note": "  "}, ""),
        ({"roughness_um": 2.0}, "/cycles"),
        ({"cycles": -1, "roughness_um": 2.0}, "/cycles"),
        ({"cycles": 5, "roughness_um": 0.0}, "/roughness_um"),
        ({"cycles": 5, "roughness_um": "2"}, "/roughness_um"),
        ({"cycles": 5, "skewness": float("nan")}, "/skewness"),
        ({"cycles": 5, "skewness": 1.0, "performed_at": "2026-11-02T08:00:00"}, "/performed_at"),
        ({"cycles": 5, "note": "x", "colour": "brown"}, "/colour"),
    ],
)
def test_an_inspection_that_is_wrong_is_refused_with_its_place(
    shared_client: TestClient, body: dict[str, Any], pointer: str
) -> None:
    answer = shared_client.post(LIST, content=json.dumps(body), headers={"Content-Type": "application/json"})
    assert answer.status_code == 422, answer.text
    assert [error["pointer"] for error in answer.json()["errors"]] == [pointer]
    assert shared_client.get(LIST).json() == {"items": [], "next": None}


def test_inspections_are_listed_by_cycles_and_as_a_table(client: TestClient) -> None:
    for body in (WORN, FRESH, FRESH | {"cycles": 3000}):
        inspected(client, body)
    whole = client.get(LIST)
    assert [item["cycles"] for item in whole.json()["items"]] == [0, 3000, 11000]
    assert client.get(LIST, headers={"If-None-Match": whole.headers["etag"]}).status_code == 304
    table = csv.DictReader(io.StringIO(client.get(f"{LIST}.csv").text))
    measured = [(row["cycles"], row["roughness_um"], row["skewness"]) for row in table]
    assert measured == [("0", "9.52", "-0.87"), ("3000", "9.52", "-0.87"), ("11000", "1.94", "-3.4")]


def test_an_inspection_is_withdrawn_with_a_reason_and_restored(client: TestClient) -> None:
    address = inspected(client)
    _, photograph = post(client, address, png())
    tag = client.get(LIST).headers["etag"]
    assert client.post(f"{address}/withdraw", json={}).status_code == 422
    for _ in range(2):  # what is so already is not changed
        answer = client.post(f"{address}/withdraw", json={"reason": "the other bench's disc"})
        assert (answer.status_code, answer.json()["state"]) == (200, "withdrawn")
    assert client.get(LIST).headers["etag"] != tag
    assert client.get(photograph).status_code == 200
    again = client.post(LIST, json=WORN)
    assert (again.status_code, again.json()["state"]) == (200, "withdrawn")
    answer = client.post(f"{address}/restore", json={"reason": "it was ours"})
    assert (answer.status_code, answer.json()["state"]) == (200, "accepted")
    trail = client.get(f"{BASE}/changes").json()["items"]
    assert [entry["action"] for entry in trail] == ["restore_inspection", "withdraw_inspection"]
    assert {entry["run_id"] for entry in trail} == {None}
    assert [entry["reason"] for entry in trail] == ["it was ours", "the other bench's disc"]
    of_it = {"inspection_id": address.rsplit("/", 1)[1], "cycles": 11000}
    assert (trail[1]["before"], trail[1]["after"]) == (of_it | {"state": "accepted"}, of_it | {"state": "withdrawn"})


def test_an_inspection_changes_no_prediction_and_an_archived_clutch_may_be_inspected(client: TestClient) -> None:
    post_tests(client, 0, 1000, 2000)
    life, clutch = (client.get(f"{BASE}{path}") for path in ("/remaining-useful-life", ""))
    inspected(client)
    assert client.get(f"{BASE}/remaining-useful-life").headers["etag"] == life.headers["etag"]
    assert client.get(BASE).json() == clutch.json()
    assert client.patch(BASE, json={"archived": True}).status_code == 200
    assert client.get(inspected(client, FRESH)).status_code == 200


def test_what_is_not_there_is_not_found(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    inspection_id = inspected(client).rsplit("/", 1)[1]
    for clutch_id, name in (("c2", inspection_id), ("c1", "nothing"), ("nobody", inspection_id)):
        address = f"/v1/clutches/{clutch_id}/inspections/{name}"
        assert client.get(address).status_code == 404
        assert client.post(f"{address}/withdraw", json={"reason": "x"}).status_code == 404
    for suffix in ("", ".csv"):
        assert client.get(f"/v1/clutches/nobody/inspections{suffix}").status_code == 404
    assert client.post("/v1/clutches/nobody/inspections", json=WORN).status_code == 404


def test_an_inspection_names_the_key_that_sent_it(client: TestClient) -> None:
    headers = granted(client, "ingest")
    answer = client.post(LIST, json=WORN, headers=headers)
    assert (answer.status_code, answer.json()["received_by"].split()[-1]) == (201, "ingest")
    refused = client.post(f"{answer.headers['location']}/withdraw", json={"reason": "x"}, headers=headers)
    assert refused.status_code == 403


# --- Photographs are files of an inspection: kept once, served as they were sent, and harmless in a browser.


def post(client: TestClient, address: str, content: bytes, media_type: str = "image/png") -> tuple[int, str]:
    """Post a photograph; the status, and its address."""
    answer = client.post(f"{address}/photographs", content=content, headers={"Content-Type": media_type})
    return answer.status_code, answer.headers.get("location", "")


@pytest.mark.parametrize(
    ("content", "media_type"), [(png(), "image/png"), (JPEG, "image/jpeg"), (WEBP, "image/webp; q=1")]
)
def test_a_photograph_comes_back_as_it_was_sent(client: TestClient, content: bytes, media_type: str) -> None:
    address = inspected(client)
    status, photograph = post(client, address, content, media_type)
    assert (status, photograph) == (201, f"{address}/photographs/{sha256(content)}")
    answer = client.get(photograph)
    assert (answer.status_code, answer.content) == (200, content)
    assert answer.headers["content-type"] == media_type.partition(";")[0]
    (listed,) = client.get(address).json()["photographs"]
    assert (listed["photograph_id"], listed["bytes"], listed["received_by"]) == (sha256(content), len(content), "local")


def test_a_browser_runs_nothing_of_a_photograph_and_keeps_it(client: TestClient) -> None:
    _, photograph = post(client, inspected(client), png(size=600))
    headers = client.get(photograph, headers={"Accept-Encoding": "gzip"}).headers
    assert headers["content-security-policy"] == "default-src 'none'; sandbox"
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["cache-control"] == "private, no-cache"
    assert "content-encoding" not in headers
    unchanged = client.get(photograph, headers={"If-None-Match": headers["etag"]})
    assert (unchanged.status_code, unchanged.content) == (304, b"")


def test_the_same_photograph_sent_twice_is_one_photograph(client: TestClient, database_url: str) -> None:
    worn, fresh = inspected(client, WORN), inspected(client, FRESH)
    assert [post(client, worn, png())[0] for _ in range(3)] == [201, 200, 200]
    assert [post(client, worn, png(red=200))[0], post(client, fresh, png())[0]] == [201, 201]
    assert [len(client.get(address).json()["photographs"]) for address in (worn, fresh)] == [2, 1]
    with closing(sqlite3.connect(database_url.removeprefix("sqlite:///"))) as connection:
        assert connection.execute("SELECT count(*) FROM photograph").fetchone() == (2,)


@pytest.mark.parametrize(
    ("content", "media_type", "status"),
    [
        (b"<svg/>", "image/svg+xml", 415),
        (png(), "application/octet-stream", 415),
        (png(), "", 415),
        (png(), "image/jpeg", 422),
        (JPEG, "image/webp", 422),
        (b"<script>alert(1)</script>", "image/png", 422),
        (b"", "image/png", 422),
        (b"RIFF\x10\0\0\0WAVEfmt ", "image/webp", 422),
    ],
)
def test_a_file_that_is_no_photograph_of_its_type_is_refused(
    client: TestClient, content: bytes, media_type: str, status: int
) -> None:
    address = inspected(client)
    answer = client.post(f"{address}/photographs", content=content, headers={"Content-Type": media_type})
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert client.get(address).json()["photographs"] == []


def test_photographs_are_bounded_in_size_and_number(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.web.routes.inspections.MAX_PHOTOGRAPH_BYTES", 1000)
    monkeypatch.setattr(inspect_clutch, "MAX_PHOTOGRAPHS", 2)
    address = inspected(client, FRESH)
    assert [post(client, address, png(red=red))[0] for red in (1, 2, 3, 2)] == [201, 201, 409, 200]
    address = inspected(client)
    assert post(client, address, png() + bytes(1000 - len(png())))[0] == 201
    answer = client.post(f"{address}/photographs", content=png() + bytes(1000), headers={"Content-Type": "image/png"})
    assert (answer.status_code, "at most 1000 bytes" in answer.json()["detail"]) == (413, True)


def test_a_photograph_is_found_below_its_own_inspection_only(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    worn, fresh = inspected(client, WORN), inspected(client, FRESH)
    elsewhere = inspected(client, WORN, "c2")
    _, photograph = post(client, worn, png())
    name = photograph.rsplit("/", 1)[1]
    found = [client.get(f"{address}/photographs/{name}").status_code for address in (worn, fresh, elsewhere)]
    assert found == [200, 404, 404]
    assert post(client, f"{worn[:-1]}x", png())[0] == 404
    bound = granted(client, "read", clutches=["c2"])
    assert client.get(photograph, headers=bound).status_code == 403
    assert client.get(f"{elsewhere}/photographs/{name}", headers=bound).status_code == 404
