"""How long the clutch page takes in a real browser: from the data's arrival until a person can use it."""

import statistics

from playwright.sync_api import Browser, Page

from tests.browser.driving import chromium, pointed_at
from tests.browser.lives import demo
from tests.measuring import show
from tests.support import served

REPEATS = 5
_LAST = (
    "performance.getEntriesByType('resource').filter((one) => one.name.includes('series?quantity=')).at(-1).responseEnd"
)
ROWS = (
    "clutch page, the demo's life: first chart seen after its data arrived, nothing cached",
    "the same, from the address entered",
    "the same, the files cached",
    "the chart that can be zoomed in its place, after it was pointed at, nothing cached",
    "the same, the library cached",
)


def pages() -> None:
    """The clutch page on the demo's life; the fleet's is in the table of `make scale`."""
    with served() as (server, http), chromium() as browser:
        demo(http)
        found = [_clutch(browser, f"{server.url}/clutches/sim-1") for _ in range(REPEATS)]
    medians = map(statistics.median, zip(*found, strict=True))
    rows = ({"what": name, "ms": f"{ms:.0f}"} for name, ms in zip(ROWS, medians, strict=True))
    show("## The pages, in Chromium", rows)


def marked(page: Page, mark: str) -> float:
    """Milliseconds from the start to a mark, waited for; the page's policy lets no condition be evaluated inside it."""
    while (at := page.evaluate(f"performance.getEntriesByName({mark!r})[0]?.startTime ?? null")) is None:
        page.wait_for_timeout(5)
    return float(at)


def _clutch(browser: Browser, address: str) -> tuple[float, ...]:
    """Milliseconds to the first chart, drawn light, and to the one of the plotting library in its place.

    The first from the arrival of its data, from the start, and from the start with files cached; the second from the moment
    at which someone points at the first, and the same with files cached.
    """
    context = browser.new_context()
    page = context.new_page()
    taken: list[tuple[float, float, float]] = []
    for _ in range(2):
        page.goto(address)
        seen, pointed = marked(page, "sketched fan"), page.evaluate("performance.now()")
        pointed_at(page)
        drawn = marked(page, "drawn fan")
        taken.append((page.evaluate(_LAST), seen, drawn - pointed))
        page.goto("about:blank")
    context.close()
    (arrived, seen, drawn), (_, seen_cached, drawn_cached) = taken
    return seen - arrived, seen, seen_cached, drawn, drawn_cached


if __name__ == "__main__":
    pages()
