"""The pages' files: what is compressed; and the API's own page."""

import gzip
import re

import pytest
from playwright.sync_api import Browser

from tests.support import Server


def test_files_go_out_compressed(server: Server) -> None:
    assets = re.search(r"/assets/[0-9a-f]+", server.http.get("/").text)
    name = f"{assets[0]}/shared/style.css"
    with server.http.stream("GET", name, headers={"Accept-Encoding": "gzip"}) as answer:
        raw = b"".join(answer.iter_raw())
    plain = server.http.get(name, headers={"Accept-Encoding": "identity"})
    assert gzip.decompress(raw).decode() == plain.text
    assert len(raw) < 0.5 * len(plain.content)
    assert "content-encoding" not in plain.headers
    assert plain.headers["etag"] != answer.headers["etag"]


@pytest.mark.parametrize("path", ["/", "/compare", "/clutches/bench", "/help/", "/docs"])
def test_no_page_may_load_what_is_not_a_file_of_the_service(server: Server, path: str) -> None:
    policy = server.http.get(path).headers["content-security-policy"]
    allowed = dict(part.strip().split(" ", 1) for part in policy.split(";"))
    assert set(allowed.values()) <= {"'self'", "'none'", "'self' data:"}
    assert [name for name, sources in allowed.items() if "data:" in sources] == (["img-src"] if path == "/docs" else [])


@pytest.mark.browser
@pytest.mark.slow  # that no page loads anything from elsewhere tests/service/web/test_root_path.py says of its addresses
def test_the_api_describes_itself_without_the_internet(server: Server, browser: Browser) -> None:
    page = browser.new_page()
    requested: list[str] = []
    logged: list[str] = []
    page.on("request", lambda request: requested.append(request.url))
    page.on("console", lambda message: logged.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: logged.append(str(error)))
    page.goto(f"{server.url}/docs")
    page.get_by_text("/v1/clutches/{clutch_id}/remaining-useful-life", exact=True).wait_for()
    assert page.get_by_role("heading", name="Clutchlife").is_visible()
    assert [url for url in requested if not url.startswith((server.url, "data:"))] == []
    assert [line for line in logged if line.startswith(("error", "Refused"))] == []
    ran = page.evaluate("""() => {
      const script = document.createElement("script");
      script.textContent = "window.ran = true";
      document.body.append(script);
      return window.ran === true;
    }""")
    assert not ran, "a script in the page would reach the key that the dashboard keeps"
    assert any("Content Security Policy" in line for line in logged)
