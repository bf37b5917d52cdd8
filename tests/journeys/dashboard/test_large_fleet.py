"""A fleet of hundreds: the page holds the rows in sight, shows the others when it is scrolled, and finds one far down."""

import json
from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.driving import Watched
from tests.lab.scale.copies import life, multiply, name
from tests.support import Server, serving, stationary

pytestmark = pytest.mark.browser

CLUTCHES = 250
MAX_ROWS = 150
#: Rows that touch differ by less, px.
GAP = 2
PHONE = {"width": 390, "height": 844}
WIDE = {"width": 1360, "height": 900}
ROWS = "table.fleet tbody tr"
#: The rows in sight, by their place in the list, and where they begin and end [px].
_IN_SIGHT = """rows => rows.map((row) => [row.getBoundingClientRect(), Number(row.ariaRowIndex), row.dataset.clutch])
  .filter(([box]) => box.bottom > 0 && box.top < innerHeight)
  .map(([box, place, clutch]) => [place, clutch, box.top, box.bottom])"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    path = tmp_path_factory.mktemp("large") / "clutchlife.db"
    life(
        f"sqlite:///{path}",
        [json.dumps(stationary(cycles, wear=cycles / 26_000)).encode() for cycles in range(0, 8000, 2000)],
    )
    multiply(f"sqlite:///{path}", CLUTCHES)
    with serving(path, loaded=True) as running:
        yield running


def opened(watched: Watched) -> Page:
    page = watched.open("/")
    page.locator(ROWS).first.wait_for()
    expect(page.locator("table.fleet")).to_have_attribute("aria-rowcount", str(CLUTCHES + 1))
    return page


def most(url: str) -> int:
    """How many rows a request asks for."""
    return int(url.partition("limit=")[2].partition("&")[0])


def in_sight(page: Page) -> list[tuple[int, str, float, float]]:
    return [tuple(row) for row in page.eval_on_selector_all(ROWS, _IN_SIGHT)]


def settled(page: Page) -> list[tuple[int, str, float, float]]:
    """The rows in sight, once they fill what is in sight below the head of the table."""
    for _ in range(200):
        shown = in_sight(page)
        if (
            shown
            and (shown[0][2] <= GAP or shown[0][0] == 2)
            and (shown[-1][3] >= 844 - 2 * GAP or shown[-1][0] == CLUTCHES + 1)
        ):
            return shown
        page.wait_for_timeout(50)
    raise AssertionError(f"the rows in sight do not fill the page: {shown}")


def goes_to(page: Page, key: str, clutch: str) -> None:
    """A key that scrolls brings a clutch in sight; without a window, Chromium now and then drops the key, which is pressed
    again then."""
    link = page.locator(f"{ROWS} a", has_text=clutch)
    for _ in range(4):
        page.keyboard.press(key)
        with suppress(AssertionError):
            expect(link).to_be_in_viewport(timeout=5_000)
            return
    expect(link).to_be_in_viewport()


@pytest.mark.slow
@pytest.mark.parametrize("viewport", [WIDE, PHONE], ids=["wide", "phone"])
def test_scrolling_shows_every_row_and_the_page_holds_few(
    browser: Browser, server: Server, viewport: dict[str, int]
) -> None:
    watched = Watched(browser, server.url, viewport=viewport)
    page = opened(watched)
    seen: dict[int, str] = {}
    far = viewport is PHONE  # there the way is cut short
    for _ in range(200):
        shown = settled(page)
        places = [place for place, *_ in shown]
        assert places == list(range(places[0], places[0] + len(places)))
        assert all(abs(below[2] - above[3]) <= GAP for above, below in pairwise(shown)), "rows overlap or leave gaps"
        assert page.locator(ROWS).count() <= MAX_ROWS
        seen |= {place: clutch for place, clutch, *_ in shown}
        if places[-1] == CLUTCHES + 1 or (far and places[0] > 100):
            break
        page.evaluate("scrollBy(0, 500)")
    last = max(seen)
    assert seen == {place: name(place - 2) for place in range(2, last + 1)}
    assert last == CLUTCHES + 1 or far
    goes_to(page, "End", name(CLUTCHES - 1))
    settled(page)
    goes_to(page, "Home", name(0))
    assert page.locator(ROWS).count() <= MAX_ROWS
    watched.close()


def test_a_jump_into_the_middle_reads_only_what_is_in_sight(watched: Watched) -> None:
    page = opened(watched)
    first, *after = [url for url in watched.asked if "/v1/clutches?" in url]
    assert most(first) * 44 - 44 < page.evaluate("innerHeight") <= most(first) * 44, "a screen"
    assert [most(url) for url in after] in ([], [80])
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight / 2)")
    shown = settled(page)
    assert abs(shown[0][0] - CLUTCHES / 2) < 30
    lists = [url for url in watched.asked if "/v1/clutches?" in url]
    assert len(lists) <= 6
    assert all(most(url) <= MAX_ROWS for url in lists)
    before = shown[0]
    page.wait_for_timeout(4000)  # a poll moves nothing
    assert settled(page)[0] == before


@pytest.mark.slow
def test_search_finds_one_far_down_and_chips_count_what_is_found(watched: Watched) -> None:
    page = opened(watched)
    page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")
    settled(page)
    wanted = name(CLUTCHES - 3)
    page.get_by_label("Find").fill(wanted.upper())
    expect(page.locator(ROWS)).to_have_count(1)
    expect(page.get_by_role("link", name=wanted)).to_be_in_viewport()
    expect(page.locator("#chips")).to_contain_text("1 clutch")
    page.get_by_label("Find").fill("")
    expect(page.get_by_role("button", name=f"{CLUTCHES} clutches")).to_be_visible()
    expect(page.get_by_role("link", name=name(0), exact=True)).to_be_visible()


@pytest.mark.slow
def test_the_focus_stays_while_the_rows_about_it_change(watched: Watched) -> None:
    page = opened(watched)
    link = page.get_by_role("link", name=name(60), exact=True)
    link.focus()
    settled(page)
    for number in range(61, 130):
        for _ in ("the box that chooses it", "its name"):
            page.keyboard.press("Tab")
            assert page.evaluate("document.activeElement.closest('tr').dataset.clutch") == name(number)
        if number % 10 == 0:  # nobody is faster than the rows ahead
            page.get_by_role("link", name=name(number + 11), exact=True).wait_for(state="attached")
    assert page.locator(ROWS).count() <= MAX_ROWS
