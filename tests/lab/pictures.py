"""`make picture`: the pictures in the README and docs: what `make demo` prints, and the dashboard in a real browser."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import httpx2
from playwright.sync_api import Browser, Page
from rich.console import Console

from tests.browser.driving import chromium, drawn, turned
from tests.browser.lives import demo, post
from tests.lab.measuring import ROOT
from tests.support import served, stationary

FIGURES = ROOT / "docs" / "figures"
MOST_BYTES = 300_000


def demo_output() -> None:
    """Of the demo: it is run, and what it printed is drawn."""
    command = [sys.executable, "-m", "service.cli.main", "demo", "--exit"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    text = re.sub(r"its database in \S+", "its database in a temporary folder", done.stdout.replace("\r", ""))
    console = Console(record=True, width=84, file=sys.stderr, highlight=False)
    console.print(text.strip("\n"), markup=False)
    drawn = console.export_svg(title="make demo")
    # a picture that asks no other host for its font
    drawn = re.sub(r"@font-face \{.*?\}\s*", "", drawn, flags=re.DOTALL)
    (FIGURES / "demo.svg").write_text(drawn, encoding="utf-8")


def dashboard() -> None:
    with served() as (server, http), chromium() as browser:
        _fill(http)
        with _page(browser, 1280, 640) as page:
            page.goto(server.url)
            page.locator("table.fleet tbody tr").first.wait_for()
            _take(page, "fleet")
        with _page(browser, 1280, 960) as page:
            page.goto(f"{server.url}/clutches/sim-2")
            drawn(page)
            _take(page, "clutch")
            turned(page, "diagnosis").locator("#diagnosis").get_by_role("button", name="Run the diagnosis").click()
            page.locator("#diagnosis .verdict").wait_for(timeout=600_000)
            _section(page, "diagnosis", "diagnosis", height=1240)
            _section(page, "curves", "stribeck", height=1060)
        with _page(browser, 1280, 900, scheme="dark") as page:
            page.goto(f"{server.url}/clutches/sim-2")
            drawn(page)
            _section(page, "curves", "parameters", height=900, name="dark")
            turned(page, "overview")
            page.locator("#report .drawing").nth(1).wait_for(state="attached")
            page.emulate_media(media="print")
            page.evaluate("document.body.style.padding = '24px'")  # a printer's margins
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
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
    page = context.new_page()
    page.set_default_timeout(60_000)
    yield page
    context.close()


def _section(page: Page, tab: str, section: str, *, height: int, name: str = "") -> None:
    """A section of a tab from its heading on, its charts drawn."""
    turned(page, tab)
    page.set_viewport_size({"width": page.viewport_size["width"], "height": height})
    page.evaluate("(id) => document.getElementById(id).scrollIntoView()", section)
    for chart in page.locator(f"#{section} figure.chart:visible:not(.empty)").all():
        if chart.bounding_box()["y"] < height:
            chart.and_(page.locator("[data-drawn]")).wait_for()
    page.evaluate("(id) => document.getElementById(id).scrollIntoView()", section)
    page.wait_for_timeout(1500)
    _take(page, name or section)


def _take(page: Page, name: str) -> None:
    path = FIGURES / f"dashboard-{name}.png"
    page.screenshot(path=path)
    size = path.stat().st_size
    print(f"{path.name}: {size / 1000:.0f} kB", file=sys.stderr)
    assert size < MOST_BYTES, f"{path.name} has {size} bytes, more than {MOST_BYTES}"


if __name__ == "__main__":
    demo_output()
    dashboard()
