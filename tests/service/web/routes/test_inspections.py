"""What is found on a clutch's lining is stored beside its runs, listed by cycles, and withdrawn where it was a slip."""

import csv
import io
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.web.routes.granting import granted
from tests.service.web.routes.surfaces import FRESH, WORN, inspected
from tests.support import stationary

BASE = "/v1/clutches/c1"
LIST = f"{BASE}/inspections"


def test_an_inspection_is_stored_as_it_was_sent_and_its_repeat_is_the_same_one(client: TestClient) -> None:
    address = inspected(client)
    stored = client.get(address).json()
    assert stored | WORN == stored
    assert (stored["state"], stored["received_by"], stored["origin"], stored["photographs"]) == (
        "accepted", "local", "measured", [],
    )  # fmt: skip
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
        ({"cycles": 5, "roughness_um": -2.0}, "/roughness_um"),
        ({"cycles": 5, "roughness_um": "2"}, "/roughness_um"),
        ({"cycles": 5, "skewness": 1e5}, "/skewness"),
        ({"cycles": 5, "skewness": 1.0, "performed_at": "2026-11-02T08:00:00"}, "/performed_at"),
        ({"cycles": 5, "note": "x" * 4001}, "/note"),
        ({"cycles": 5, "note": "x", "colour": "brown"}, "/colour"),
    ],
)
def test_an_inspection_that_is_wrong_is_refused_with_its_place(
    client: TestClient, body: dict[str, Any], pointer: str
) -> None:
    answer = client.post(LIST, json=body)
    assert answer.status_code == 422, answer.text
    assert [error["pointer"] for error in answer.json()["errors"]] == [pointer]
    assert client.get(LIST).json() == {"items": [], "next": None}


@pytest.mark.parametrize("skewness", ["NaN", "Infinity"])
def test_a_number_that_is_not_finite_is_refused(client: TestClient, skewness: str) -> None:
    body = f'{{"cycles": 5, "skewness": {skewness}}}'
    assert client.post(LIST, content=body, headers={"Content-Type": "application/json"}).status_code == 422


def test_a_skewness_alone_a_roughness_alone_and_a_note_alone_are_inspections(client: TestClient) -> None:
    for body in ({"cycles": 5, "skewness": 0.4}, {"cycles": 5, "roughness_um": 3.1}, {"cycles": 5, "note": "glazed"}):
        assert client.get(inspected(client, body)).json() | body == client.get(inspected_again(client, body)).json()


def inspected_again(client: TestClient, body: dict[str, Any]) -> str:
    answer = client.post(LIST, json=body)
    assert answer.status_code == 200
    return str(answer.headers["location"])


def test_inspections_are_listed_by_cycles_page_by_page_and_as_a_table(client: TestClient) -> None:
    for body in (WORN, FRESH, FRESH | {"cycles": 3000}):
        inspected(client, body)
    whole = client.get(LIST)
    assert [item["cycles"] for item in whole.json()["items"]] == [0, 3000, 11000]
    assert client.get(LIST, headers={"If-None-Match": whole.headers["etag"]}).status_code == 304
    for suffix, count in (("", lambda page: len(page.json()["items"])), (".csv", lambda page: len(rows(page.text)))):
        pages, following = [], f"{LIST}{suffix}?limit=2"
        while following:
            page = client.get(following)
            pages.append(count(page))
            following = page.links["next"]["url"] if "next" in page.links else ""
        assert pages == [2, 1]
    table = rows(client.get(f"{LIST}.csv").text)
    assert [(row["cycles"], row["roughness_um"], row["skewness"]) for row in table] == [
        ("0", "9.52", "-0.87"), ("3000", "9.52", "-0.87"), ("11000", "1.94", "-3.4"),
    ]  # fmt: skip
    assert client.get(f"{LIST}?cursor=nonsense").status_code == 422


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_an_inspection_is_withdrawn_with_a_reason_and_restored(client: TestClient) -> None:
    address = inspected(client)
    tag = client.get(LIST).headers["etag"]
    assert client.post(f"{address}/withdraw", json={}).status_code == 422
    for _ in range(2):  # what is so already is not changed
        answer = client.post(f"{address}/withdraw", json={"reason": "the other bench's disc"})
        assert (answer.status_code, answer.json()["state"]) == (200, "withdrawn")
    assert client.get(LIST).headers["etag"] != tag
    again = client.post(LIST, json=WORN)
    assert (again.status_code, again.json()["state"]) == (200, "withdrawn")
    answer = client.post(f"{address}/restore", json={"reason": "it was ours"})
    assert (answer.status_code, answer.json()["state"]) == (200, "accepted")
    trail = client.get(f"{BASE}/changes").json()["items"]
    assert [(entry["action"], entry["reason"], entry["run_id"]) for entry in trail] == [
        ("restore_inspection", "it was ours", None), ("withdraw_inspection", "the other bench's disc", None),
    ]  # fmt: skip
    inspection_id = address.rsplit("/", 1)[1]
    assert trail[1]["before"] == {"inspection_id": inspection_id, "cycles": 11000, "state": "accepted"}
    assert trail[1]["after"] == {"inspection_id": inspection_id, "cycles": 11000, "state": "withdrawn"}


def test_an_inspection_changes_no_prediction_and_makes_no_diagnosis_stale(client: TestClient) -> None:
    for cycles in (0, 1000, 2000):
        assert client.post(f"{BASE}/runs", json=stationary(cycles)).status_code == 201
    life, clutch = (client.get(f"{BASE}{path}") for path in ("/remaining-useful-life", ""))
    inspected(client)
    assert client.get(f"{BASE}/remaining-useful-life").headers["etag"] == life.headers["etag"]
    assert client.get(BASE).json() == clutch.json()


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


def test_an_archived_clutch_may_still_be_inspected(client: TestClient) -> None:
    assert client.patch(BASE, json={"archived": True}).status_code == 200
    assert client.get(inspected(client)).status_code == 200


def test_an_inspection_names_the_key_that_sent_it(client: TestClient) -> None:
    headers = granted(client, "ingest")
    answer = client.post(LIST, json=WORN, headers=headers)
    assert (answer.status_code, answer.json()["received_by"].split()[-1]) == (201, "ingest")
    refused = client.post(f"{answer.headers['location']}/withdraw", json={"reason": "x"}, headers=headers)
    assert refused.status_code == 403
