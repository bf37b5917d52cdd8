"""What the routes answer: files by their path, and nothing that is not one of them, whatever the address looks like."""

import asyncio
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI

from service.dashboard import assets, pages

LOADED = assets.load()


@pytest.fixture(scope="module")
def app() -> FastAPI:
    """The pages alone."""
    made = FastAPI()
    made.include_router(pages.router(LOADED))
    return made


def get(app: FastAPI, path: str) -> tuple[int, bytes]:
    """Status and body; the path reaches the routes as it stands, as no client would let it through."""
    scope: dict[str, Any] = {
        "type": "http", "method": "GET", "path": path, "raw_path": path.encode(), "root_path": "", "scheme": "http",
        "http_version": "1.1", "query_string": b"", "headers": [], "server": ("127.0.0.1", 80), "client": None,
    }  # fmt: skip
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(app(scope, receive, send))
    return sent[0]["status"], b"".join(message.get("body", b"") for message in sent)


@pytest.mark.parametrize("name", sorted(name for name in LOADED.by_name if not name.endswith(".html")))
def test_every_file_is_served_under_its_path(app: FastAPI, name: str) -> None:
    assert get(app, f"/assets/{LOADED.digest}/{name}") == (200, LOADED.by_name[name].body)


@pytest.mark.parametrize(
    "name",
    [
        "../pages.py", "../../dashboard/pages.py", "shared/../../pages.py", "shared/../shared/api.js", "./shared/api.js",
        "..%2fpages.py", "%2e%2e/pages.py", "..\\pages.py", "shared\\api.js", "/etc/passwd", "//etc/passwd", "", "/",
        "shared", "shared/", "shared//api.js", "shared/api.js/", "shared/api.js\0", "SHARED/api.js", "api.js",
        "static/shared/api.js", "shared/types.d.ts", "fleet.html", "clutch.html",
    ],
)  # fmt: skip
def test_nothing_else_is(app: FastAPI, name: str) -> None:
    status, body = get(app, f"/assets/{LOADED.digest}/{name}")
    assert status == 404
    assert len(body) < 200


def test_no_request_touches_the_disk(app: FastAPI, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("a request opened a file")

    monkeypatch.setattr("builtins.open", refuse)
    monkeypatch.setattr("io.open", refuse)
    monkeypatch.setattr(Path, "read_bytes", refuse)
    with pytest.raises(AssertionError, match="opened a file"):
        assets.load()
    assert get(app, "/")[0] == 200
    assert get(app, "/clutches/any")[0] == 200
    assert get(app, f"/assets/{LOADED.digest}/shared/api.js")[0] == 200
    assert get(app, f"/assets/{LOADED.digest}/../pages.py")[0] == 404
