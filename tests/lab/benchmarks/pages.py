"""How long the pages take in a real browser: from the address, or the data's arrival, until a person can use them."""

import json
import statistics
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Browser, Page

from tests.browser.driving import chromium
from tests.browser.lives import demo
from tests.lab.measuring import show
from tests.lab.scale.copies import life, multiply
from tests.support import served, serving, stationary

REPEATS = 5
#: The start page's clutches, and how many times slower the processor is.
CLUTCHES, SLOWER = 200, 4
_LAST = (
    "performance.getEntriesByType('resource').filter((one) => one.name.includes('series?quantity=')).at(-1).responseEnd"
)
ROWS = (
    "clutch page, the demo's life: first chart seen after its data arrived, nothing cached",
    "the same, from the address entered",
    "the same, the files cached",
)


def pages() -> None:
    """The clutch page on the demo's life."""
    with served() as (server, http), chromium() as browser:
        demo(http)
        found = [_clutch(browser, f"{server.url}/clutches/sim-1") for _ in range(REPEATS)]
    medians = map(statistics.median, zip(*found, strict=True))
    rows = ({"what": name, "ms": f"{ms:.0f}"} for name, ms in zip(ROWS, medians, strict=True))
    show("## The pages, in Chromium", rows)


def start_page() -> None:
    """The start page with CLUTCHES clutches on a machine so many times slower, nothing cached."""
    with TemporaryDirectory() as folder, chromium() as browser:
        path = Path(folder) / "clutches.db"
        runs = [stationary(cycles, wear=cycles / 26_000) for cycles in range(0, 8000, 2000)]
        life(f"sqlite:///{path}", [json.dumps(run).encode() for run in runs])
        multiply(f"sqlite:///{path}", CLUTCHES)
        with serving(path) as server:
            found = [_start_page(browser, server.url) for _ in range(REPEATS)]
    medians = map(statistics.median, zip(*found, strict=True))
    titles = (f"start page, {CLUTCHES} clutches, {SLOWER}x slower: first paint", "the same: the first rows")
    rows = ({"what": name, "ms": f"{ms:.0f}"} for name, ms in zip(titles, medians, strict=True))
    show("## The start page, in Chromium", rows)


def _start_page(browser: Browser, address: str) -> tuple[float, float]:
    """Milliseconds from the address to the first paint, and to the first rows."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    page.context.new_cdp_session(page).send("Emulation.setCPUThrottlingRate", {"rate": SLOWER})
    page.goto(address)
    rows = marked(page, "fleet-shown")
    paint = marked(page, "first-contentful-paint")
    context.close()
    return paint, rows


def marked(page: Page, mark: str) -> float:
    """Milliseconds from the start to a mark, waited for; the page's policy lets no condition be evaluated inside it."""
    while (at := page.evaluate(f"performance.getEntriesByName({mark!r})[0]?.startTime ?? null")) is None:
        page.wait_for_timeout(5)
    return float(at)


def _clutch(browser: Browser, address: str) -> tuple[float, ...]:
    """Milliseconds to the first chart: from the arrival of its data, from the start, and the same with the files cached."""
    context = browser.new_context()
    page = context.new_page()
    taken: list[tuple[float, float]] = []
    for _ in range(2):
        page.goto(address)
        taken.append((marked(page, "drawn fan"), page.evaluate(_LAST)))
        page.goto("about:blank")
    context.close()
    (seen, arrived), (seen_cached, _) = taken
    return seen - arrived, seen, seen_cached


if __name__ == "__main__":
    pages()
    start_page()
