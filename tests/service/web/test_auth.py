"""Without keys, this machine only, under no other name than its own."""

import pytest
from fastapi.testclient import TestClient

from service.web.auth import is_loopback


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
