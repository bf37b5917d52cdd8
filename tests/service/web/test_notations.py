"""What is sent twice in two notations is one thing: identity is of values."""

import json
import unicodedata
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.support import stationary

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


def test_a_run_at_another_instant_is_another_run(client: TestClient) -> None:
    body = stationary(0, run_id="test-1", pressures=(5.0,))
    for started_at, status in ((INSTANTS[0], 201), ("2026-11-02T08:00:00Z", 409), ("2026-11-02T07:00:00.5Z", 409)):
        assert sent(client, json.dumps(body | {"started_at": started_at})).status_code == status


def test_a_number_is_the_same_however_it_is_written(client: TestClient) -> None:
    duty = '{"cycles": %s, "energy_per_cycle_kj": %s, "engagement_duration_s": null, "initial_speed_rpm": %s}'
    texts = [
        '{"kind": "duty_cycles", "cycles": 7000, "duty": %s, "started_at": null}' % (duty % ("7000", "18", "-0.0")),
        '{"kind": "duty_cycles", "cycles": 7e3, "duty": %s}' % (duty % ("7000.0", "1.8E+1", "0")),
        '{"duty": {"initial_speed_rpm": 0e5, "energy_per_cycle_kj": 18.00, "cycles": 70e2}, "cycles": 7000.0, '
        '"run_id": null, "kind": "duty_cycles", "channels": null, "origin": "measured"}',
    ]
    assert_one(client, texts)


def test_the_numbers_of_a_channel_are_the_same_however_they_are_written(client: TestClient) -> None:
    text = (
        '{"kind": "stationary_stribeck", "cycles": 0, "channels": {"speed_rpm": [%s, 500, 1000, 2e3], '
        '"pressure_bar": [5, 5, 5, 5], "torque_nm": [21, 22.50, 21.8, 21], "torque_sd_nm": null}}'
    )
    assert_one(client, [text % zero for zero in ("-0.0", "0", "0.0", "-0")])


def test_a_remark_is_the_same_in_every_normal_form(client: TestClient) -> None:
    body = {"kind": "maintenance", "cycles": 10, "event": "other", "note": "Ölwechsel bei Gerät Å"}
    assert_one(
        client,
        [
            unicodedata.normalize(form, json.dumps(body, ensure_ascii=escaped))
            for form in ("NFC", "NFD")
            for escaped in (False, True)
        ],
    )


def test_a_clutch_is_the_same_however_its_record_is_written(client: TestClient) -> None:
    texts = [
        '{"clutch_id": "c2", "geometry": {"inner_diameter_mm": 99, "friction_faces": 2}, "fluid": "Öl", '
        '"torque_filter_ms": null}',
        '{"fluid": "O\\u0308l", "geometry": {"friction_faces": 2.0, "inner_diameter_mm": 9.9e1}, "clutch_id": "c2"}',
    ]
    assert [sent(client, text, CLUTCHES).status_code for text in texts] == [201, 200]
    wrong = sent(client, '{"clutch_id": "c3", "geometry": {"friction_faces": 2.5}}', CLUTCHES)
    assert (wrong.status_code, wrong.json()["errors"][0]["pointer"]) == (422, "/geometry/friction_faces")


def test_an_inspection_is_the_same_however_it_is_written(client: TestClient) -> None:
    texts = [
        f'{{"cycles": {cycles}, "performed_at": "{performed_at}", "roughness_um": {roughness}, "skewness": null}}'
        for cycles, roughness in (("7000", "3"), ("7e3", "3.0"))
        for performed_at in INSTANTS
    ]
    assert_one(client, texts, "/v1/clutches/c1/inspections")


BODY = json.dumps({"kind": "maintenance", "cycles": 1, "event": "other", "note": "Öl"}, ensure_ascii=False)


def test_a_byte_order_mark_before_a_body_is_taken_off(client: TestClient) -> None:
    marked = client.post(RUNS, content=BODY.encode("utf-8-sig"), headers=JSON)
    assert marked.status_code == 201
    assert sent(client, BODY).json() == marked.json() | {"duplicate": True}
    record = json.dumps({"clutch_id": "c2"}).encode("utf-8-sig")
    assert client.post(CLUTCHES, content=record, headers=JSON).status_code == 201


@pytest.mark.parametrize(
    ("encoding", "named"),
    [
        ("utf-16", "UTF-16"),
        ("utf-16-le", "UTF-16"),
        ("utf-16-be", "UTF-16"),
        ("utf-32", "UTF-32"),
        ("utf-32-le", "UTF-32"),
        ("utf-32-be", "UTF-32"),
        ("latin-1", "0xd6, which is 'Ö' in Latin-1"),
    ],
)
def test_a_body_in_another_encoding_is_refused_by_its_name(client: TestClient, encoding: str, named: str) -> None:
    for body in (BODY, json.dumps([{}] * 20_000) + BODY):
        answer = client.post(RUNS, content=body.encode(encoding), headers=JSON)
        assert answer.status_code == 422
        if encoding != "latin-1" or body is BODY:
            assert named in answer.json()["detail"]
            assert "UTF-8" in answer.json()["detail"]
            assert answer.json()["errors"][0]["code"] == "encoding"
