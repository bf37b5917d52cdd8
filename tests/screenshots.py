"""`make picture`: the dashboard's pictures in the README and docs, taken from a running service in a real browser."""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx2
from playwright.sync_api import Browser, Page

from tests.browser.driving import chromium, pointed_at, turned
from tests.browser.lives import demo, post
from tests.support import serving, stationary

DOCS = Path(__file__).parents[1] / "docs" / "figures"
MOST_BYTES = 300_000


def main() -> None:
    """Take all pictures."""
    with (
        tempfile.TemporaryDirectory() as folder,
        serving(Path(folder) / "pictures.db") as server,
        httpx2.Client(base_url=server.url, timeout=120) as http,
        chromium() as browser,
    ):
        _fill(http)
        with _page(browser, 1280, 640) as page:
            page.goto(server.url)
            page.locator("table.fleet tbody tr").first.wait_for()
            _take(page, "fleet")
        with _page(browser, 1280, 960) as page:
            _opened(page, f"{server.url}/clutches/sim-2")
            _take(page, "clutch")
            turned(page, "diagnosis").locator("#diagnosis").get_by_role("button", name="Run the diagnosis").click()
            page.locator("#diagnosis .verdict").wait_for(timeout=600_000)
            _section(page, "diagnosis", "diagnosis", height=1240)
            _section(page, "curves", "stribeck", height=720)
        with _page(browser, 1280, 900, scheme="dark") as page:
            _opened(page, f"{server.url}/clutches/sim-2")
            _section(page, "curves", "parameters", height=900, name="dark")
            turned(page, "overview")
            page.locator("#report img").nth(1).wait_for(state="attached")
            page.emulate_media(media="print")
            page.add_style_tag(content="body { padding: 24px }")  # a printer's margins
            page.set_viewport_size({"width": 808, "height": 1130})
            page.evaluate("scrollTo(0, 0)")
            page.wait_for_timeout(500)
            _take(page, "report")
        with _page(browser, 390, 844) as page:
            page.goto(server.url)
            page.locator("table.fleet tbody tr").first.wait_for()
            _take(page, "phone")


def _fill(http: httpx2.Client) -> None:
    """A fleet of simulated clutches at different ages, and one that was only just mounted."""
    for seed, last in ((1, 99_000), (2, 7000), (3, 4000), (4, 9000), (5, 2000)):
        demo(http, seed, last)
    post(http, "sim-2", {"kind": "maintenance", "cycles": 4000, "event": "other", "note": "plates inspected"})
    http.post("/v1/clutches", json={"clutch_id": "bench3-017"}).raise_for_status()
    post(http, "bench3-017", stationary(0))


@contextmanager
def _page(browser: Browser, width: int, height: int, scheme: str = "light") -> Iterator[Page]:
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)  # type: ignore[arg-type]
    page = context.new_page()
    page.set_default_timeout(60_000)
    yield page
    context.close()


def _opened(page: Page, address: str) -> None:
    page.goto(address)
    pointed_at(page)


def _section(page: Page, tab: str, section: str, *, height: int, name: str = "") -> None:
    """A section of a tab from its heading on, its charts drawn."""
    turned(page, tab)
    size = page.viewport_size
    assert size is not None
    page.set_viewport_size({"width": size["width"], "height": height})
    page.evaluate("(id) => document.getElementById(id).scrollIntoView()", section)
    for chart in page.locator(f"#{section} figure.chart:visible:not(.empty)").all():
        if chart.bounding_box()["y"] < height:  # type: ignore[index]
            chart.and_(page.locator("[data-drawn]")).wait_for()
    page.evaluate("(id) => document.getElementById(id).scrollIntoView()", section)
    page.wait_for_timeout(1500)
    _take(page, name or section)


def _take(page: Page, name: str) -> None:
    path = DOCS / f"dashboard-{name}.png"
    page.screenshot(path=path)
    size = path.stat().st_size
    print(f"{path.name}: {size / 1000:.0f} kB", file=sys.stderr)
    assert size < MOST_BYTES, f"{path.name} has {size} bytes, more than {MOST_BYTES}"


if __name__ == "__main__":
    main()
