"""Behind a proxy that adds a path: the command line and the pages in a browser."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest
from playwright.sync_api import Browser, expect

from tests.browser.driving import Watched
from tests.support import ONCE, clutchlife, serving, stationary

BELOW = "/tools/clutch"


@contextmanager
def proxy(upstream: str) -> Iterator[str]:
    """A proxy that serves `upstream` below `BELOW` and takes the path off, as nginx and Caddy do; gives its address."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            if not self.path.startswith(f"{BELOW}/"):
                self._answer(404, {}, b"")
                return
            length = int(self.headers.get("Content-Length") or 0)
            headers = {name: value for name, value in self.headers.items() if name.lower() != "connection"}
            answer = http.request(
                self.command,
                upstream + self.path.removeprefix(BELOW),
                content=self.rfile.read(length),
                headers=headers | {"X-Forwarded-For": "10.0.0.9"},
            )
            self._answer(answer.status_code, dict(answer.headers), answer.read())

        do_POST = do_GET  # noqa: N815  (the library's name)

        def _answer(self, status: int, headers: dict[str, str], body: bytes) -> None:
            self.send_response(status)
            for name, value in headers.items():
                if name not in ("content-length", "content-encoding", "transfer-encoding", "connection"):
                    self.send_header(name, value)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    with httpx2.Client(timeout=120) as http, ThreadingHTTPServer(("127.0.0.1", 0), Handler) as listening:
        threading.Thread(target=listening.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{listening.server_port}{BELOW}"
        listening.shutdown()


@pytest.fixture(scope="module")
def below(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a service behind such a proxy, with three tests that were sent through it."""
    folder = tmp_path_factory.mktemp("proxy")
    environment = {"CLUTCHLIFE_ROOT_PATH": BELOW, "CLUTCHLIFE_INSECURE_LOCAL": "true"}
    with serving(folder / "clutchlife.db", loaded=True, environment=environment) as server, proxy(server.url) as url:
        ONCE.post(f"{url}/v1/clutches", json={"clutch_id": "bench"}).raise_for_status()
        for cycles in (0, 1000, 2000):
            ONCE.post(f"{url}/v1/clutches/bench/runs", json=stationary(cycles)).raise_for_status()
        yield url


@pytest.mark.slow
def test_the_command_line_finds_the_service_below_the_path(below: str, tmp_path: Path) -> None:
    clutchlife("simulate", "--seed", "7", "--no-dynamic", "--tests", "4", "--out", tmp_path / "campaign")
    sent = ("push", tmp_path / "campaign", "--clutch", "sim-7", "--url", below, "--spool", tmp_path / "spool")
    assert ", 0 refused" in clutchlife(*sent)
    assert "sim-7" in clutchlife("life", "sim-7", "--url", f"{below}/")
    assert "verdict" in clutchlife("diagnose", "sim-7", "--url", below, "--json").lower()
    clutchlife("export", "sim-7", "--out", tmp_path / "all", "--url", below)
    assert (tmp_path / "all" / "clutch.json").is_file()


@pytest.mark.browser
def test_pages_work_below_the_path(below: str, browser: Browser) -> None:
    watched = Watched(browser, below)
    page = watched.page
    page.goto(f"{below}/")
    page.get_by_role("link", name="bench").click()
    expect(page).to_have_url(f"{below}/clutches/bench")
    page.locator("#chart-fan .plot").wait_for()
    page.get_by_role("link", name="All clutches").click()
    expect(page).to_have_url(f"{below}/")
    with page.expect_response(f"{below}/openapi.json"):
        page.get_by_role("link", name="API").click()
    strays = [url for url in watched.asked if url.startswith("http") and not urlsplit(url).path.startswith(BELOW)]
    assert strays == []
    watched.context.close()
