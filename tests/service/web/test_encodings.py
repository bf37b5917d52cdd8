"""gzip both ways: fewer bytes on the wire, the same answers, and a tag for each form of an answer."""

import gzip
import json
import zlib

import pytest
from fastapi.testclient import TestClient

from tests.support import stationary

RUNS = "/v1/clutches/c1/runs"
GZIP = {"Content-Encoding": "gzip", "Content-Type": "application/json"}
PLAIN = {"Accept-Encoding": "identity"}


def post(client: TestClient, body: bytes, **headers: str) -> tuple[int, dict[str, object]]:
    answer = client.post(RUNS, content=body, headers=GZIP | headers)
    return answer.status_code, answer.json()


def test_a_run_that_is_sent_packed_is_the_run_that_is_sent_plain(client: TestClient) -> None:
    body = stationary(0, run_id="r")
    assert post(client, gzip.compress(json.dumps(body).encode()))[0] == 201
    again = client.post(RUNS, json=body)
    assert (again.status_code, again.json()["duplicate"]) == (200, True)


def test_what_is_not_packed_as_it_says_is_refused(client: TestClient) -> None:
    packed = gzip.compress(json.dumps(stationary(0)).encode())
    for body, says in (
        (json.dumps(stationary(0)).encode(), "is not"),
        (packed[:-20], "cut off"),
        (b"", "cut off"),
        (packed + packed, "goes on after the end"),
    ):
        status, answer = post(client, body)
        assert (status, answer["type"]) == (422, "urn:clutchlife:problem:invalid-content")
        assert says in str(answer["detail"])
    assert client.get(RUNS).json()["items"] == []


@pytest.mark.parametrize("encoding", ["br", "deflate", "gzip, gzip"])
def test_an_encoding_that_is_not_taken_is_refused_with_the_one_that_is(client: TestClient, encoding: str) -> None:
    answer = client.post(RUNS, content=zlib.compress(b"{}"), headers=GZIP | {"Content-Encoding": encoding})
    assert (answer.status_code, answer.headers["accept-encoding"]) == (415, "gzip")
    assert answer.headers["content-type"] == "application/problem+json"


def test_a_bomb_meets_the_bound_on_bodies(client: TestClient) -> None:
    status, answer = post(client, gzip.compress(b"[" * (64 << 20)))
    assert (status, answer["type"]) == (413, "urn:clutchlife:problem:too-large")


@pytest.mark.parametrize("name", ["series", "series.csv", "degradation", "runs"])
def test_an_answer_is_packed_for_who_takes_it_and_each_form_has_its_tag(client: TestClient, name: str) -> None:
    for cycles in (0, 1000):
        assert client.post(RUNS, json=stationary(cycles)).status_code == 201
    address = f"/v1/clutches/c1/{name}"
    for _ in range(2):  # the second time as a poll
        plain, packed = client.get(address, headers=PLAIN), client.get(address)
        assert "content-encoding" not in plain.headers
        assert (packed.headers["content-encoding"], packed.content) == ("gzip", plain.content)
        assert int(packed.headers["content-length"]) < len(plain.content) // 2
        assert "Accept-Encoding" in packed.headers["vary"]
        assert packed.headers["etag"] != plain.headers["etag"]
        for answer in (plain, packed):
            tag = answer.headers["etag"]
            again = client.get(address, headers={"If-None-Match": tag})
            assert (again.status_code, again.headers["etag"]) == (304, tag)
    assert client.post(RUNS, json=stationary(2000)).status_code == 201
    assert client.get(address, headers={"If-None-Match": packed.headers["etag"]}).status_code == 200
    head = client.head(address)
    assert head.headers["etag"] == client.get(address).headers["etag"]


def test_a_short_answer_stays_as_it_is(client: TestClient) -> None:
    assert "content-encoding" not in client.get("/v1/clutches/c1/model").headers
