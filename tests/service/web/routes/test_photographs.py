"""Photographs are files of an inspection: kept once, served as they were sent, and harmless in a browser."""

import sqlite3
from contextlib import closing

import pytest
from fastapi.testclient import TestClient

from service.schemas import base
from service.workflows import inspect_clutch
from tests.service.web.routes.granting import granted
from tests.service.web.routes.surfaces import FRESH, JPEG, WEBP, WORN, inspected, png, sha256


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


def test_a_photograph_that_is_too_large_is_refused(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.web.routes.inspections.MAX_PHOTOGRAPH_BYTES", 1000)
    address = inspected(client)
    assert post(client, address, png() + bytes(1000 - len(png())))[0] == 201
    answer = client.post(f"{address}/photographs", content=png() + bytes(1000), headers={"Content-Type": "image/png"})
    assert (answer.status_code, "at most 1000 bytes" in answer.json()["detail"]) == (413, True)
    assert base.MAX_PHOTOGRAPH_BYTES == 16 * 2**20


def test_an_inspection_has_only_so_many_photographs(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inspect_clutch, "MAX_PHOTOGRAPHS", 2)
    address = inspected(client)
    assert [post(client, address, png(red=red))[0] for red in (1, 2, 3, 2)] == [201, 201, 409, 200]


def test_a_photograph_is_found_below_its_own_inspection_only(client: TestClient) -> None:
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    worn, fresh = inspected(client, WORN), inspected(client, FRESH)
    elsewhere = inspected(client, WORN, "c2")
    _, photograph = post(client, worn, png())
    name = photograph.rsplit("/", 1)[1]
    assert [client.get(f"{address}/photographs/{name}").status_code for address in (worn, fresh, elsewhere)] == [
        200, 404, 404,
    ]  # fmt: skip
    assert post(client, f"{worn[:-1]}x", png())[0] == 404
    bound = granted(client, "read", clutches=["c2"])
    assert client.get(photograph, headers=bound).status_code == 403
    assert client.get(f"{elsewhere}/photographs/{name}", headers=bound).status_code == 404


def test_a_withdrawn_inspection_keeps_its_photographs(client: TestClient) -> None:
    address = inspected(client)
    _, photograph = post(client, address, png())
    assert client.post(f"{address}/withdraw", json={"reason": "a slip"}).status_code == 200
    assert client.get(photograph).status_code == 200
