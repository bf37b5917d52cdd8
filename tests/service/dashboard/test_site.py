"""`/help`: the built site, or how to build it."""

from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from service.dashboard import site


def client_of(folder: Path) -> TestClient:
    app = FastAPI()
    app.include_router(site.router(folder))
    return TestClient(app)


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    (tmp_path / "how-to").mkdir()
    (tmp_path / "index.html").write_text("<p>first</p>", encoding="utf-8")
    (tmp_path / "how-to" / "index.html").write_text("<p>tasks</p>", encoding="utf-8")
    (tmp_path / "searchindex.js").write_text("Search.setIndex({})", encoding="utf-8")
    (tmp_path / "objects.inv").write_bytes(b"no page")
    return client_of(tmp_path)


def test_pages_and_what_they_load_are_served(client: TestClient) -> None:
    assert client.get("/help").text == "<p>first</p>", "by a redirect to the address with the slash"
    assert client.get("/help/how-to/").text == "<p>tasks</p>"
    script = client.get("/help/searchindex.js")
    assert script.headers["content-type"].startswith("text/javascript")
    assert (
        client.get("/help/index.html", headers={"If-None-Match": client.get("/help/").headers["etag"]}).status_code
        == 304
    )


@pytest.mark.parametrize("name", ["missing.html", "objects.inv", "../pages.py", "%2e%2e/pages.py", "how-to"])
def test_other_files_are_not(client: TestClient, name: str) -> None:
    assert client.get(f"/help/{name}").status_code == 404


def test_where_nothing_was_built_the_answer_says_how(tmp_path: Path) -> None:
    answer = client_of(tmp_path / "missing").get("/help/")
    assert answer.status_code == 404
    assert "make docs" in answer.text
