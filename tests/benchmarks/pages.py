"""How long the pages take in a real browser: from the data's arrival until a person can use them."""

import statistics
from collections.abc import Sequence
from contextlib import closing

import httpx2
from playwright.sync_api import Browser, Page

from service.lives import condition
from storage import clutches
from storage.engine.opening import open_database
from tests.browser.driving import chromium, pointed_at
from tests.browser.lives import demo
from tests.measuring import show
from tests.support import Server, served

CLUTCHES, REPEATS = 1000, 5
_LAST = "performance.getEntriesByType('resource').filter((entry) => entry.name.includes({0!r})).at(-1).responseEnd"
_FIRST = "performance.getEntriesByType('resource').find((entry) => entry.name.includes({0!r})).responseEnd"
_MARK = "performance.getEntriesByName({0!r})[0].startTime"


def pages() -> None:
    """The fleet with 1,000 clutches; the clutch page on the demo's life."""
    with served() as (server, http), chromium() as browser:
        demo(http)
        _multiply(server, http)
        size = len(http.get("/v1/clutches?limit=80").content)
        fleet = [_fleet(browser, server.url) for _ in range(REPEATS)]
        clutch = [_clutch(browser, server.url) for _ in range(REPEATS)]
    rows = {
        f"fleet, {CLUTCHES} clutches ({size / 1000:.0f} kB of rows): a full screen that answers, after the data arrived": (
            _middle(fleet, 0)
        ),
        "a full screen, from the address entered": _middle(fleet, 1),
        "clutch page, the demo's life: first chart seen after its data arrived, nothing cached": _middle(clutch, 0),
        "the same, from the address entered": _middle(clutch, 1),
        "the same, the files cached": _middle(clutch, 2),
        "the chart that can be zoomed in its place, after it was pointed at, nothing cached": _middle(clutch, 3),
        "the same, the library cached": _middle(clutch, 4),
    }
    show("The pages, in Chromium", "what | ms", ((name, f"{taken:.0f}") for name, taken in rows.items()))


def _middle(found: Sequence[tuple[float, ...]], place: int) -> float:
    return statistics.median(each[place] for each in found)


def _multiply(server: Server, http: httpx2.Client) -> None:
    """The demo's summary under 999 more names, a little worse each."""
    for index in range(CLUTCHES - 1):
        http.post("/v1/clutches", json={"clutch_id": f"bench-{index:03}"}).raise_for_status()
    with closing(open_database(server.address)) as database, database.writing() as connection:
        row = clutches.get(connection, "sim-1")
        for index in range(CLUTCHES - 1):
            quantiles = {"0.05": 900, "0.25": 1000, "0.5": 1100, "0.75": 1200, "0.95": 1400}
            remaining = {q: value + 7.0 * index for q, value in quantiles.items()}
            current = dict(row.summary["current"]) | {"health": index / CLUTCHES}
            summary = dict(row.summary) | {
                "status": "predicted",
                "remaining_cycles": remaining,
                "at_least": remaining["0.05"],
                "current": current,
            }
            state = condition.state_of(summary, disputed=False)["name"]
            clutches.set_summary(
                connection, f"bench-{index:03}", remaining["0.5"], summary, life="", state=state, if_disputed=state
            )


def _fleet(browser: Browser, url: str) -> tuple[float, float]:
    """Milliseconds after the data until the screen is full and answers, and from the start."""
    page = browser.new_page()
    page.goto(url)
    _until(page, "fleet-shown")
    assert page.locator("table.fleet").get_attribute("aria-rowcount") == str(CLUTCHES + 1)
    shown = page.evaluate(_MARK.format("fleet-shown"))
    arrived = page.evaluate(_FIRST.format("/v1/clutches?"))
    page.close()
    return shown - arrived, shown


def _until(page: Page, mark: str) -> None:
    """Wait for a mark; the page's policy lets no condition be evaluated inside it."""
    while not page.evaluate(f"performance.getEntriesByName({mark!r}).length"):
        page.wait_for_timeout(20)


def _clutch(browser: Browser, url: str) -> tuple[float, ...]:
    """Milliseconds to the first chart, drawn light, and to the one of the plotting library in its place.

    The first from the arrival of its data, from the start, and from the start with files cached; the second from the moment
    at which someone points at the first, and the same with files cached.
    """
    context = browser.new_context()
    page = context.new_page()
    taken: list[tuple[float, float, float]] = []
    for _ in range(2):
        page.goto(f"{url}/clutches/sim-1")
        _until(page, "sketched fan")
        pointed = page.evaluate("performance.now()")
        pointed_at(page)
        seen, drawn = (page.evaluate(_MARK.format(mark)) for mark in ("sketched fan", "drawn fan"))
        taken.append((page.evaluate(_LAST.format("quantity=")), seen, drawn - pointed))
        page.goto("about:blank")
    context.close()
    (arrived, seen, drawn), (_, seen_cached, drawn_cached) = taken
    return seen - arrived, seen, seen_cached, drawn, drawn_cached


if __name__ == "__main__":
    pages()
