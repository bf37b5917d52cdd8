"""However it is written or packed, a body is the run that it holds."""

import gzip
import json
import unicodedata
import zlib
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.support import post_tests, stationary

# --- What is sent twice in two notations is one thing: identity is of values.

CLUTCHES, RUNS = "/v1/clutches", "/v1/clutches/c1/runs"
JSON = {"Content-Type": "application/json"}
#: 08:00 in winter in Germany.
INSTANTS = (
    "2026-11-02T08:00:00+01:00",
    "2026-11-02T07:00:00Z",
    "2026-11-02T07:00:00.000Z",
    "2026-11-02 08:00:00+0100",
    "2026-11-02t02:00:00-05:00",
    "2026-11-02T07:00+00:00",
    "2026-11-02T07:00:00,0-00:00",
    "2026-11-03T06:59:00+23:59",
)


def sent(client: TestClient, text: str, path: str = RUNS) -> Any:
    """The answer to a body in that notation."""
    return client.post(path, content=text.encode(), headers=JSON)


def assert_one(client: TestClient, texts: list[str], path: str = RUNS) -> None:
    """The first is stored, and all others are the same."""
    answers = [sent(client, text, path) for text in texts]
    assert [answer.status_code for answer in answers] == [201] + [200] * (len(texts) - 1), answers[-1].json()
    kept = [answer.json() | {"duplicate": False} for answer in answers]
    assert all(answer == kept[0] for answer in kept)
    assert len(client.get(path).json()["items"]) == 1


@pytest.mark.parametrize("run_id", [None, "test-1"])
def test_a_run_at_one_instant_is_one_run_in_whatever_time_zone_it_is_stated(
    client: TestClient, run_id: str | None
) -> None:
    body = stationary(0, run_id=run_id, pressures=(5.0,))
    assert_one(client, [json.dumps(body | {"started_at": started_at}) for started_at in INSTANTS])
    assert client.get(RUNS).json()["items"][0]["started_at"] == INSTANTS[0]
    for another in ("2026-11-02T08:00:00Z", "2026-11-02T07:00:00.5Z"):
        answer = sent(client, json.dumps(body | {"started_at": another}))
        assert answer.status_code == (201 if run_id is None else 409)


DUTY = '{"cycles": %s, "energy_per_cycle_kj": %s, "engagement_duration_s": null, "initial_speed_rpm": %s}'
CHANNELS = (
    '{"kind": "stationary_stribeck", "cycles": 0, "channels": {"speed_rpm": [%s, 500, 1000, 2e3], '
    '"pressure_bar": [5, 5, 5, 5], "torque_nm": [21, 22.50, 21.8, 21], "torque_sd_nm": null}}'
)
REMARK = {"kind": "maintenance", "cycles": 10, "event": "other", "note": "Ölwechsel bei Gerät Å"}
INSPECTION = '{"cycles": %s, "performed_at": "%s", "roughness_um": %s, "skewness": null}'
WRITTEN = {
    "numbers": [
        '{"kind": "duty_cycles", "cycles": 7000, "duty": %s, "started_at": null}' % (DUTY % ("7000", "18", "-0.0")),
        '{"kind": "duty_cycles", "cycles": 7e3, "duty": %s}' % (DUTY % ("7000.0", "1.8E+1", "0")),
        '{"duty": {"initial_speed_rpm": 0e5, "energy_per_cycle_kj": 18.00, "cycles": 70e2}, "cycles": 7000.0, '
        '"run_id": null, "kind": "duty_cycles", "channels": null, "origin": "measured"}',
    ],
    "channels": [CHANNELS % zero for zero in ("-0.0", "0", "0.0", "-0")],
    "normal forms": [
        unicodedata.normalize(form, json.dumps(REMARK, ensure_ascii=ascii_alone))
        for form in ("NFC", "NFD")
        for ascii_alone in (False, True)
    ],
    "inspection": [
        INSPECTION % (cycles, performed_at, roughness)
        for cycles, roughness in (("7000", "3"), ("7e3", "3.0"))
        for performed_at in INSTANTS
    ],
}


@pytest.mark.parametrize("written", WRITTEN)
def test_values_are_the_same_however_they_are_written(client: TestClient, written: str) -> None:
    assert_one(client, WRITTEN[written], "/v1/clutches/c1/inspections" if written == "inspection" else RUNS)


def test_a_clutch_is_the_same_however_its_record_is_written(client: TestClient) -> None:
    texts = [
        '{"clutch_id": "c2", "geometry": {"inner_diameter_mm": 99, "friction_faces": 2}, "fluid": "Öl", '
        '"torque_filter_ms": null}',
        '{"fluid": "O\\u0308l", "geometry": {"friction_faces": 2.0, "inner_diameter_mm": 9.9e1}, "clutch_id": "c2"}',
    ]
    assert [sent(client, text, CLUTCHES).status_code for text in texts] == [201, 200]
    wrong = sent(client, '{"clutch_id": "c3", "geometry": {"friction_faces": 2.5}}', CLUTCHES)
    assert (wrong.status_code, wrong.json()["errors"][0]["pointer"]) == (422, "/geometry/friction_faces")


BODY = json.dumps({"kind": "maintenance", "cycles": 1, "event": "other", "note": "Öl"}, ensure_ascii=False)


def test_a_byte_order_mark_before_a_body_is_taken_off(client: TestClient) -> None:
    marked = client.post(RUNS, content=BODY.encode("utf-8-sig"), headers=JSON)
    assert marked.status_code == 201
    assert sent(client, BODY).json() == marked.json() | {"duplicate": True}
    record = json.dumps({"clutch_id": "c2"}).encode("utf-8-sig")
    assert client.post(CLUTCHES, content=record, headers=JSON).status_code == 201


UTFS = ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be")


@pytest.mark.parametrize("encoding", [*UTFS, "latin-1"])
def test_a_body_in_another_encoding_is_refused_by_its_name(shared_client: TestClient, encoding: str) -> None:
    named = "0xd6, which is 'Ö' in Latin-1" if encoding == "latin-1" else encoding.upper()[:6]
    for body in (BODY, json.dumps([{}] * 20_000) + BODY):
        answer = shared_client.post(RUNS, content=body.encode(encoding), headers=JSON)
        assert answer.status_code == 422
        if encoding != "latin-1" or body is BODY:
            assert named in answer.json()["detail"]
            assert "UTF-8" in answer.json()["detail"]
            assert answer.json()["errors"][0]["code"] == "encoding"


# --- gzip both ways: fewer bytes on the wire, the same answers, and a tag for each form of an answer.

GZIP = {"Content-Encoding": "gzip", "Content-Type": "application/json"}
PLAIN = {"Accept-Encoding": "identity"}


def post(client: TestClient, body: bytes, **headers: str) -> tuple[int, dict[str, object]]:
    answer = client.post(RUNS, content=body, headers=GZIP | headers)
    return answer.status_code, answer.json()


def test_a_run_that_is_sent_packed_is_the_run_that_is_sent_plain_and_one_that_only_says_so_is_refused(
    client: TestClient,
) -> None:
    packed = gzip.compress(json.dumps(stationary(0)).encode())
    for body, says in (
        (json.dumps(stationary(0)).encode(), "is not"),
        (packed[:-20], "cut off"),
        (b"", "cut off"),
        (packed + packed, "more bytes after the end"),
    ):
        status, answer = post(client, body)
        assert (status, answer["type"]) == (422, "urn:clutchlife:problem:invalid-content")
        assert says in str(answer["detail"])
    assert client.get(RUNS).json()["items"] == []
    assert post(client, packed)[0] == 201
    again = client.post(RUNS, json=stationary(0))
    assert (again.status_code, again.json()["duplicate"]) == (200, True)


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
    post_tests(client, 0, 1000)
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
    assert "content-encoding" not in client.get("/v1/clutches/c1/model").headers, "a short one stays as it is"
