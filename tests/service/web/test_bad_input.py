"""What must not come in does not: each gets the contract's status, a message with channel, row and value, and no trace."""

import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.clients import client_of
from tests.support import stationary

RUNS = "/v1/clutches/c1/runs"


def content(path: Path) -> list[str]:
    """Everything in the database, as text."""
    with sqlite3.connect(path) as connection:
        found = list(connection.iterdump())
    connection.close()
    return found


@pytest.fixture(scope="module")
def database_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("bad") / "clutchlife.db"


@pytest.fixture(scope="module")
def client(database_file: Path) -> Iterator[TestClient]:
    """One for all: what is refused leaves nothing behind."""
    with client_of(database_file) as found:
        yield found


@pytest.fixture(scope="module")
def known(client: TestClient) -> dict[str, Any]:
    """A run that is there already."""
    body = stationary(0, run_id="known")
    assert client.post(RUNS, json=body).status_code == 201
    return body


def spoiled(channel: str, index: int, value: Any) -> dict[str, Any]:
    """A good run with one value replaced."""
    body = stationary(1000, run_id="new")
    body["channels"][channel][index] = value
    return body


LEVELS = tuple(4 + 0.5 * number for number in range(101))
CASES = [
    (spoiled("torque_nm", 17, float("nan")), "/channels/torque_nm/17", 18, "nan", "not_finite"),
    (spoiled("torque_nm", 3, float("inf")), "/channels/torque_nm/3", 4, "inf", "not_finite"),
    (spoiled("speed_rpm", 5, -20.0), "/channels/speed_rpm/5", 6, "-20.0", "negative"),
    (spoiled("pressure_bar", 0, -5.0), "/channels/pressure_bar/0", 1, "-5.0", "negative"),
    (spoiled("pressure_bar", 9, "5"), "/channels/pressure_bar/9", 10, "'5'", "not_a_number"),
    (spoiled("torque_nm", 9, None), "/channels/torque_nm/9", 10, "None", "not_a_number"),
    (spoiled("torque_nm", 9, True), "/channels/torque_nm/9", 10, "True", "not_a_number"),
    (spoiled("torque_nm", 9, [1.0]), "/channels/torque_nm/9", 10, "[1.0]", "not_a_number"),
    (spoiled("torque_nm", 9, 10**400), "/channels/torque_nm/9", 10, None, None),
    (spoiled("speed_rpm", 9, 1e9), "/channels/speed_rpm/9", 10, "1000000000.0", "out_of_range"),
    (stationary(-1), "/cycles", None, "-1", "greater_than_equal"),
    (stationary(0) | {"cycles": "7"}, "/cycles", None, "'7'", "float_type"),
    (stationary(0) | {"cycles": float("nan")}, "/cycles", None, "nan", "finite_number"),
    (stationary(0) | {"colour": 1}, "/colour", None, "1", "extra_forbidden"),
    (stationary(0) | {"revision": 1}, "/revision", None, "1", "extra_forbidden"),
    (stationary(0) | {"kind": "dyno"}, "/kind", None, None, "union_tag_invalid"),
    (stationary(0) | {"run_id": "a/b"}, "/run_id", None, "'a/b'", "string_pattern_mismatch"),
    (stationary(0) | {"channels": {}}, "/channels/pressure_bar", None, "", "missing"),
    (stationary(0) | {"channels": 5}, "/channels", None, "5", None),
    (stationary(0) | {"started_at": "2026-11-02T08:00:00"}, "/started_at", None, None, "timezone_aware"),
    (stationary(0) | {"started_at": "0001-01-01T00:00:00Z"}, "/started_at", None, None, "greater_than_equal"),
    (stationary(0) | {"started_at": "9999-12-31T23:59:59-23:59"}, "/started_at", None, None, "less_than_equal"),
    (stationary(0, pressures=(5.0,), speeds=(500,)), "/channels/torque_nm/0", 1, None, "too_few_points"),
    (stationary(0, speeds=(500,)), "/channels/speed_rpm/0", 1, "500", "speeds_all_equal"),
    (stationary(0, pressures=(0.0, 0.02), speeds=(0,)), "/channels/speed_rpm/0", 1, "0", "open_at_rest"),
    (stationary(0) | {"started_at": 5}, "/started_at", None, "5", None),
    (stationary(0, pressures=LEVELS), "/channels/pressure_bar/0", 1, None, "too_many_levels"),
    ({"kind": "maintenance", "cycles": 0, "event": "party"}, "/event", None, "'party'", "literal_error"),
    ({"kind": "duty_cycles", "cycles": 0}, "/duty", None, "", "missing"),
]


#: What a refusal of too little or too much says of what was counted.
COUNTED = {
    "too_few_points": "torque_nm: a Stribeck curve needs more than one point, got 1",
    "too_many_levels": "at most 100 pressure levels, got 101. Send",
    "open_at_rest": "must differ from zero, got 0 in all 2 rows",
}


@pytest.mark.parametrize(("body", "pointer", "row", "value", "code"), CASES, ids=lambda each: str(each)[:40])
def test_a_wrong_run_is_refused_and_leaves_no_trace(
    client: TestClient, known: dict[str, Any], database_file: Path, body: dict[str, Any], pointer: str, row: int | None,
    value: str | None, code: str | None,
) -> None:  # fmt: skip
    assert known
    before = content(database_file)
    answer = client.post(RUNS, content=json.dumps(body), headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert set(problem) >= {"type", "title", "status", "detail", "errors"}
    first = problem["errors"][0]
    assert (first["pointer"], first["row"]) == (pointer, row)
    assert value is None or first["value"] == value
    assert code is None or first["code"] == code
    assert COUNTED.get(first["code"], "") in problem["detail"]
    assert pointer.split("/")[-2 if row else -1] in first["message"]
    assert content(database_file) == before


@pytest.mark.parametrize("channel", ["pressure_bar", "speed_rpm", "torque_nm"])
def test_ragged_and_empty_channels_are_named(client: TestClient, channel: str) -> None:
    body = stationary(0)
    body["channels"][channel].pop()
    found = client.post(RUNS, json=body).json()["errors"]
    assert [(each["pointer"], each["code"], each["row"]) for each in found] == [(f"/channels/{channel}", "ragged", 160)]
    body["channels"][channel] = []
    assert client.post(RUNS, json=body).json()["errors"][0]["code"] == "empty"


def test_other_content_under_a_known_name_is_a_conflict(
    client: TestClient, known: dict[str, Any], database_file: Path
) -> None:
    before = content(database_file)
    assert client.post(RUNS, json=known | {"cycles": 1}).status_code == 409
    assert client.post("/v1/clutches", json={"clutch_id": "c1", "fluid": "water"}).status_code == 409
    assert content(database_file) == before


def test_what_is_no_run_at_all(client: TestClient) -> None:
    large = [b"1" * 2**20 + b"1", (b" " * 65536 for _ in range(64))]  # its length is announced, and is not
    for status, bodies in ((422, [b"", b"[1", b"null", b"\xff\xfe", b"[" * 100_000]), (413, large)):
        for body in bodies:
            answer = client.post(RUNS, content=body, headers={"Content-Type": "application/json"})
            assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("POST", "/v1/clutches"),
        ("PATCH", "/v1/clutches/c1"),
        ("PATCH", f"{RUNS}/known"),
        ("POST", f"{RUNS}/known/withdraw"),
        ("POST", "/v1/clutches/c1/inspections"),
        ("POST", "/v1/clutches/c1/remaining-useful-life/forecast"),
    ],
)
def test_only_a_run_may_be_large(client: TestClient, method: str, path: str) -> None:
    """The process that answers everybody checks other bodies itself: 6 MB of unknown fields hold it up for half a second."""
    body = json.dumps({f"k{number}": number for number in range(30_000)}).encode()
    answer = client.request(method, path, content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["detail"]) == (413, f"a request may hold at most {2**18} bytes here")
    as_run = client.post(RUNS, content=body, headers={"Content-Type": "application/json"})
    assert as_run.status_code == 422


def test_a_form_is_not_taken(client: TestClient) -> None:
    """A page in a browser can send forms and plain text across sites unasked, JSON it cannot."""
    for address, body in ((RUNS, stationary(0)), ("/v1/clutches", {"clutch_id": "new"})):
        answer = client.post(address, content=json.dumps(body), headers={"Content-Type": "text/plain"})
        assert answer.status_code == 415, address


def test_bad_questions_are_422(client: TestClient) -> None:
    numbers = ("pressure_bar=nan", "pressure_bar=-1", "at_cycles=x", "at_cycles=inf", "at_cycles=-1")
    for query in ("presure_bar=5", "method=magic", *numbers):
        assert client.get(f"/v1/clutches/c1/remaining-useful-life?{query}").status_code == 422, query
    both = client.get("/v1/clutches/c1/remaining-useful-life?method=magic&at_cycles=x").json()
    assert (len(both["errors"]), both["total_errors"], both["detail"].partition("; ")[2]) == (2, 2, "2 errors in all")
    for cursor in ("%ff", "e30", "WzFd", "!!!!", "WzEsIlx1ZDgwMCJd", "W05hTiwiYSJd", "WzFlOTk5LCJhIl0"):
        assert client.get(f"{RUNS}?cursor={cursor}").status_code == 422


@pytest.mark.parametrize(
    "record",
    [
        {"clutch_id": ""},
        {"clutch_id": "a b"},
        {"clutch_id": "c2", "geometry": {"inner_diameter_mm": 133, "outer_diameter_mm": 99}},
        {"clutch_id": "c2", "geometry": {"inner_diameter_mm": 1e-50, "outer_diameter_mm": 2e-50}},
        {"clutch_id": "c2", "geometry": {"inner_diameter_mm": 133, "outer_diameter_mm": 133.00000000000003}},
        {"clutch_id": "c2", "geometry": {"friction_faces": 0}},
        {"clutch_id": "c2", "geometry": {"friction_faces": 2.5}},
        {"clutch_id": "c2", "end_of_life": {"cof_fraction": 1.0}},
        {"clutch_id": "c2", "oil": {"kinematic_viscosity_40c_cst": 5}},
        {"clutch_id": "c2", "geometry": {"mean_radius_mm": -1}},
        {"clutch_id": "c2", "revision": 1},
        {"clutch_id": "c2", "archived": True},
        {"clutch_id": "c2", "created_at": "2020-01-01T00:00:00Z"},
        {},
    ],
    ids=str,
)
def test_a_wrong_clutch_is_422(client: TestClient, record: dict[str, Any]) -> None:
    assert client.post("/v1/clutches", json=record).status_code == 422
    assert len(client.get("/v1/clutches").json()["items"]) == 1


@pytest.mark.parametrize("cycles", [5e-324, 1.4e-168, 1e-7, 2e-6, 1e-3])
def test_a_run_at_next_to_no_cycles_is_tracked(tmp_path: Path, cycles: float) -> None:
    """What a course is up to there is lost in rounding."""
    with client_of(tmp_path / "a.db") as client:
        for number, at in enumerate((0.0, cycles)):
            receipt = client.post(RUNS, json=stationary(at, run_id=f"r{number}"))
            assert receipt.status_code == 201
            if receipt.json()["state"] == "held":
                assert client.post(f"{RUNS}/r{number}/confirm", json={}).status_code == 200
        for method in ("particle", "ukf", "grid"):
            life = client.get("/v1/clutches/c1/remaining-useful-life", params={"method": method})
            assert life.status_code == 200
            assert life.json()["as_of_cycles"] == cycles
