"""What every request has, whatever becomes of it: an id in its answer and its log lines, and a line when it has ended."""

import io
import json
import logging
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import pytest
from fastapi.testclient import TestClient

from service.logging import JsonLines
from tests.service.web.routes.granting import granted
from tests.support import stationary

Lines = Callable[[], list[dict[str, Any]]]
CLUTCH = "/v1/clutches/c1"


@pytest.fixture
def lines() -> Iterator[Lines]:
    """The lines of the log since they were asked for last, those for debugging too."""
    written = io.StringIO()
    handler = logging.StreamHandler(written)
    handler.setFormatter(JsonLines())
    logger = logging.getLogger("clutchlife")  # its level is set back after each test
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)

    def taken() -> list[dict[str, Any]]:
        text = written.getvalue()
        written.seek(0)
        written.truncate()
        return [json.loads(line) for line in text.splitlines()]

    yield taken
    logger.removeHandler(handler)


@pytest.mark.parametrize("sent", [None, "", "a b", "x" * 129, "\x1b[2J", b"\xe4"])
def test_a_request_without_a_sane_id_gets_one(client: TestClient, lines: Lines, sent: str | bytes | None) -> None:
    lines()
    headers: Any = {} if sent is None else {"X-Request-ID": sent}
    ids = [client.get(CLUTCH, headers=headers).headers["X-Request-ID"] for _ in range(3)]
    assert len(set(ids)) == 3
    assert all(len(name) == 16 for name in ids)
    assert [line["request_id"] for line in lines()] == ids


def test_a_problem_names_its_request(client: TestClient) -> None:
    for path in ("/v1/clutches/nobody", "/nowhere", "/v1/clutches?limit=0", "/v1/clutches?limits=1"):
        answer = client.get(path, headers={"X-Request-ID": "rig-7/41"})
        assert answer.status_code >= 400
        assert answer.json()["request_id"] == answer.headers["X-Request-ID"] == "rig-7/41"


def test_a_request_is_one_line_with_its_route_and_not_its_path(client: TestClient, lines: Lines) -> None:
    lines()
    body = client.get(f"{CLUTCH}/runs").content
    (line,) = lines()
    assert (line["logger"], line["level"]) == ("clutchlife.access", "info")
    assert line["message"] == "GET /v1/clutches/{clutch_id}/runs 200"
    expected = {"method": "GET", "route": "/v1/clutches/{clutch_id}/runs", "status": 200, "bytes": len(body)}
    assert expected.items() <= line.items()
    assert line["key"] == "local"
    assert 0 < line["duration_ms"] == round(line["duration_ms"], 2) < 60_000
    client.post(f"{CLUTCH}/runs", json=stationary(0.0, run_id="secret-run"))
    client.get("/v1/clutches/secret%0aclutch")
    client.get("/nowhere%0asecret")
    others = lines()
    assert [line["status"] for line in others] == [201, 404, 404]
    assert "secret" not in json.dumps(others)


def test_the_name_of_the_key_is_logged_and_never_the_key(client: TestClient, lines: Lines) -> None:
    headers = granted(client, "read")
    secret = headers["Authorization"].removeprefix("Bearer ")
    lines()
    client.get(CLUTCH, headers=headers)
    client.get(CLUTCH, headers={"Authorization": f"Bearer {secret}x"})
    client.get(f"{CLUTCH}?key={secret}", headers=headers)
    logged = lines()
    keys = [(line["status"], line["key"]) for line in logged]
    assert keys[:2] == [(200, f"key:{secret.split('_')[1]} read"), (401, None)]
    assert secret not in json.dumps(logged)


def test_what_machines_ask_again_and_again_is_logged_for_debugging_alone(client: TestClient, lines: Lines) -> None:
    tag = client.get(CLUTCH).headers["ETag"]
    lines()
    for path in ("/livez", "/readyz", "/metrics"):
        assert client.get(path).status_code == 200
    assert client.get(CLUTCH, headers={"If-None-Match": tag}).status_code == 304
    assert [(line["status"], line["level"]) for line in lines()] == [(200, "debug")] * 3 + [(304, "debug")]


@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_an_unexpected_error_is_logged_whole_and_answered_without_internals(
    client: TestClient, lines: Lines, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    def fail(*_: object) -> NoReturn:
        raise RuntimeError("the password is s3cr3t\n{forged}")

    monkeypatch.setattr("service.web.routes.clutches.clutch_list.look_up", fail)
    lines()
    answer = client.request(method, CLUTCH, headers={"X-Request-ID": "rig-7"})
    assert answer.status_code == 500
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["X-Request-ID"] == "rig-7"
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert "s3cr3t" not in answer.text + str(answer.headers)
    if method == "GET":
        assert answer.json()["request_id"] == "rig-7"
    error, request = lines()
    assert (error["level"], error["request_id"]) == ("error", "rig-7")
    assert error["message"] == f"{method} /v1/clutches/{{clutch_id}}"
    assert error["exception"].startswith("Traceback")
    assert "s3cr3t" in error["exception"]
    assert (request["level"], request["status"], request["request_id"]) == ("warning", 500, "rig-7")


def test_what_a_run_makes_the_service_say_names_the_request(
    client: TestClient, lines: Lines, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the thread or process that takes it in."""

    def speaking(*_: object, **__: object) -> NoReturn:
        logging.getLogger("clutchlife").warning("odd")
        raise RuntimeError

    monkeypatch.setattr("service.web.routes.runs.ingest_posted", speaking)
    lines()
    client.post(f"{CLUTCH}/runs", json=stationary(0.0), headers={"X-Request-ID": "rig-7"})
    odd, *_ = lines()
    assert (odd["message"], odd["request_id"]) == ("odd", "rig-7")
