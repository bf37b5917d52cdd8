"""HEAD answers wherever GET does, with the same headers and no body."""

import re
from pathlib import Path

import httpx2
from fastapi.testclient import TestClient

from tests.service.web.routes.routes_of import routes_of
from tests.support import serving, stationary

RUNS = "/v1/clutches/c1/runs"


def test_every_route_that_can_be_read_can_be_headed(client: TestClient) -> None:
    """All but when and which request it was; of what changes with every request, all but its length."""
    client.post(RUNS, json=stationary(0, run_id="known"))
    (asset,) = set(re.findall(r'"[^"]*?(assets/[^"]*/clutch\.js)"', client.get("/clutches/c1").text))
    paths = {path for method, path in routes_of(client.app.routes) if method == "GET"}  # type: ignore[attr-defined]
    assert len(paths) > 30
    wrong = []
    for path in sorted(paths):
        address = path.replace("{clutch_id}", "c1").replace("{run_id}", "known").replace("{diagnosis_id}", "d1")
        address = f"/{asset}" if path.startswith("/assets/") else address
        ignored = {"date", "x-request-id"} | ({"content-length"} if path == "/metrics" else set())
        there, head = client.get(address), client.head(address)
        headers = [
            {name: value for name, value in answer.headers.items() if name not in ignored} for answer in (there, head)
        ]
        if (head.status_code, head.content, headers[1]) != (there.status_code, b"", headers[0]):
            wrong.append((address, there.status_code, head.status_code, headers))
    assert wrong == []


def test_over_a_socket_the_connection_stays_usable(tmp_path: Path) -> None:
    """A body that was announced and sent would be read as the next answer."""
    with serving(tmp_path / "a.db", loaded=True) as server, httpx2.Client(base_url=server.url, timeout=30) as http:
        for _ in range(3):
            head = http.head("/v1/clutches")
            assert (head.status_code, head.content) == (200, b"")
            assert int(head.headers["content-length"]) > 0
            assert http.get("/v1/clutches").json() == {"items": [], "next": None}
