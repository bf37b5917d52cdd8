"""Pages in a real browser: drawn, without errors, without asking any other host."""

import pytest
from playwright.sync_api import Browser

from tests.support import Server

pytestmark = pytest.mark.browser


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
