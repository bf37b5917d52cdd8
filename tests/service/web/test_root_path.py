"""Behind a proxy that adds a path, every address that an answer names leads back through it."""

import re
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from service.settings import Settings
from tests.service.clients import client_on
from tests.support import stationary

ROOT = "/rigs/clutch"


@pytest.fixture(params=["", ROOT], ids=["the proxy takes the path off", "the proxy leaves the path"])
def proxied(request: pytest.FixtureRequest, database_url: str) -> Iterator[tuple[TestClient, str]]:
    """A service below `ROOT`, and what a request's path begins with when it comes from the proxy."""
    with client_on(database_url, root_path=ROOT) as client:
        client.follow_redirects = False
        yield client, request.param


def test_addresses_in_answers_are_named_as_the_proxy_finds_them(proxied: tuple[TestClient, str]) -> None:
    client, before = proxied
    for name in ("c1", "c2"):
        clutch = client.post(f"{before}/v1/clutches", json={"clutch_id": name})
        assert clutch.headers["Location"] == f"{ROOT}/v1/clutches/{name}"
    run = client.post(f"{before}/v1/clutches/c1/runs", json=stationary(0, run_id="r", pressures=(5.0,)))
    assert run.headers["Location"] == f"{ROOT}/v1/clutches/c1/runs/r"
    assert client.get(run.headers["Location"]).json()["run_id"] == "r"
    following = client.get(f"{before}/v1/clutches?limit=1&sort=name").links["next"]["url"]
    assert following.startswith(f"{ROOT}/v1/clutches?")
    assert [item["clutch_id"] for item in client.get(following).json()["items"]] == ["c2"]
    for path in ("/v1/clutches", "/clutches/c1", "/docs"):
        answer = client.get(f"{before}{path}/")
        assert (answer.status_code, answer.headers["Location"]) == (307, ROOT + path), "no host is named"
    answer = client.get(ROOT)
    assert (answer.status_code, answer.headers["Location"]) == (308, f"{ROOT}/")
    assert client.get(f"{before}/openapi.json").json()["servers"] == [{"url": ROOT}]


def test_pages_and_what_they_load_are_addressed_from_where_they_are(proxied: tuple[TestClient, str]) -> None:
    client, before = proxied
    for page, up in (("/", "./"), ("/clutches/c1", "../"), ("/docs", "")):
        addresses = re.findall(r'(?:href|src)="([^"#]+)"', client.get(before + page).text)
        assert addresses
        for address in addresses:
            assert address.startswith(up)
            assert not address.startswith(("/", "http")), address
            answer = client.get(f"{before}/{address.removeprefix(up)}")
            # the site is there once `make docs` has built it, and says so where it is not
            assert answer.status_code == 200 or (address == f"{up}help/" and "make docs" in answer.text), address


def test_a_path_that_cannot_be_told_from_the_service_s_own_is_refused(client: TestClient) -> None:
    routes = [getattr(route, "path", "/") for route in client.app.routes]  # type: ignore[attr-defined]
    own = {path.split("/")[1] for path in routes} - {""}
    for path in (*own, "/v1", "clutches/x", "/a b", "/../a", "/a//b", "/ä"):
        with pytest.raises(ValueError, match="CLUTCHLIFE_ROOT_PATH must be a path"):
            Settings.from_environment(root_path=path)
    assert Settings.from_environment(root_path="//").root_path == ""
