"""Without keys, this machine only, under no other name than its own."""

import socket
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from service.web.auth import is_loopback
from tests.service.web.routes.granting import granted, revoke_all
from tests.support import serving


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.0.0.1:8000", "localhost", "LOCALHOST:80", "[::1]:8000", "localhost."]
)
def test_this_machine_is_answered(client: TestClient, host: str) -> None:
    assert client.get("/v1/clutches", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "host", ["rig.example", "127.0.0.1.rig.example", "10.0.0.5:8000", "[fe80::1]", "", "localhost@evil"]
)
def test_another_name_is_refused(client: TestClient, host: str) -> None:
    """A page in a browser could have made a name of its own point here."""
    answer = client.get("/v1/clutches", headers={"Host": host})
    assert (answer.status_code, answer.headers["content-type"]) == (403, "application/problem+json")


def test_another_machine_is_refused(client: TestClient) -> None:
    elsewhere = TestClient(client.app, base_url="http://127.0.0.1", client=("192.0.2.7", 50000))
    assert elsewhere.get("/v1/clutches").status_code == 403
    assert elsewhere.get("/livez").status_code == 200


def test_loopback_names() -> None:
    assert all(is_loopback(name) for name in ("127.8.9.1", "::1", "localhost"))
    assert not any(is_loopback(name) for name in ("192.0.2.1", "example", "", "::"))


def test_after_the_last_key_is_revoked_the_service_stays_shut(client: TestClient) -> None:
    assert client.get("/v1/clutches").status_code == 200
    headers = granted(client, "admin")
    assert [client.get("/v1/clutches", headers=said).status_code for said in ({}, headers)] == [401, 200]
    revoke_all(client)
    assert [client.get("/v1/clutches", headers=said).status_code for said in ({}, headers)] == [401, 401]


PROXIED = ["Forwarded", "Via", "X-Forwarded-For", "X-Forwarded-Host", "X-Forwarded-Proto", "X-Real-IP"]
PROXIED += ["Fastly-Client-IP", "X-Original-Forwarded-For", "X-Envoy-External-Address", "CDN-Loop"]


@pytest.mark.parametrize("header", PROXIED)
def test_what_a_proxy_passes_on_is_refused_without_keys(client: TestClient, header: str) -> None:
    """It comes from this machine and may be anybody's."""
    answer = client.get("/v1/clutches", headers={header: "127.0.0.1"})
    assert (answer.status_code, header.lower() in answer.json()["detail"].lower()) == (403, True)
    assert client.get("/livez", headers={header: "127.0.0.1"}).status_code == 200


@pytest.mark.parametrize(("version", "status"), [("1.0", b"403"), ("1.1", b"200")])
def test_a_proxy_that_adds_no_header_is_known_by_its_version(tmp_path: Path, version: str, status: bytes) -> None:
    """nginx as it is installed: it asks in HTTP/1.0, under the name of this machine."""
    with serving(tmp_path / "a.db", loaded=True) as server:
        asked = f"GET /v1/clutches HTTP/{version}\r\nHost: 127.0.0.1:{server.port}\r\nConnection: close\r\n\r\n"
        with socket.create_connection(("127.0.0.1", server.port), timeout=30) as line:
            line.sendall(asked.encode())
            assert line.recv(12).partition(b" ")[2] == status


def test_insecure_local_answers_what_a_proxy_passes_on(database_url: str) -> None:
    app = create_app(Settings(workers=0, database=database_url, insecure_local=True))
    with TestClient(app, base_url="http://127.0.0.1", client=("192.0.2.7", 50000)) as client:
        assert client.get("/v1/clutches", headers={"X-Forwarded-For": "192.0.2.7"}).status_code == 200
        assert client.get("/v1/clutches", headers={"Host": "rig.example"}).status_code == 403
