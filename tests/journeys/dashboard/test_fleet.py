"""The fleet's page: empty, filling, worst first, live, by keyboard, with a service that goes away and comes back."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.driving import Watched, Wire, turned
from tests.browser.lives import post, worn
from tests.support import ONCE, Server, clutchlife, filled_service, post_tests, serving, stationary

pytestmark = pytest.mark.browser


@filled_service
def server(running: Server) -> None:
    """A worn-out clutch, an ageing one, a new one, one without a run and one whose life was ended."""
    worn(running.http, "ageing", last=4000)
    for name, last in (("worn-out", 19_000), ("new", 500)):
        running.http.post("/v1/clutches", json={"clutch_id": name, "friction_material": "<i>carbon</i>"})
        for cycles in range(0, last + 1, 500 if name == "new" else 1900):
            post(running.http, name, stationary(cycles, wear=cycles / 26_000))
    running.http.post("/v1/clutches", json={"clutch_id": "waiting"})
    running.http.post("/v1/clutches", json={"clutch_id": "ended"})
    post_tests(running.http, 0, 1000, 2000, to="ended", pressures=(5.0,))
    post(running.http, "ended", {"kind": "maintenance", "event": "end_of_life", "cycles": 3500, "reason": "worn"})


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Server]:
    with serving(tmp_path / "clutchlife.db", loaded=True) as running:
        yield running


def rows(page: Page) -> list[str]:
    page.locator("table.fleet tbody tr").first.wait_for()
    return page.locator("table.fleet tbody th a").all_inner_texts()


def test_an_empty_service_says_what_to_do_and_fills_by_itself(browser: Browser, empty: Server) -> None:
    watched = Watched(browser, empty.url)
    watched.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = watched.open("/")
    page.get_by_role("heading", name="No clutch is registered yet").wait_for()
    commands = "\n".join(page.locator("pre").all_inner_texts())
    for part in ("simulate", f"push campaign --clutch sim-7 --url {empty.url}", "register"):
        assert f"clutchlife {part}" in commands
    page.get_by_role("button", name="Copy: clutchlife simulate").click()
    page.get_by_text("copied", exact=True).wait_for()
    assert page.evaluate("navigator.clipboard.readText()").startswith("clutchlife simulate")
    page.evaluate("window.same = true")
    empty.http.post("/v1/clutches", json={"clutch_id": "first"})
    page.get_by_role("link", name="first").wait_for()
    assert page.evaluate("window.same")
    page.get_by_role("link", name="first").click()
    page.get_by_role("heading", name="No run has arrived for this clutch yet").wait_for()
    assert f"--clutch first --url {empty.url}" in page.locator("pre").first.inner_text()
    page.evaluate("window.same = true")
    post_tests(empty.http, 0, to="first", pressures=(5.0,))
    turned(page, "history").locator("#chart-predicted").get_by_text("from the third stationary test on").wait_for()
    turned(page, "loops").locator("#chart-loop-curves").get_by_text("No dynamic Stribeck test yet").wait_for()
    post_tests(empty.http, 1000, 2000, to="first", pressures=(5.0,))
    expect(turned(page, "runs").locator("#runs .runs > details")).to_have_count(3)
    turned(page, "history").locator("#chart-predicted[data-drawn]").wait_for()
    assert page.evaluate("window.same")
    watched.close()


def test_what_needs_somebody_comes_first_with_all_that_is_asked_of_a_row(watched: Watched) -> None:
    page = watched.open("/")
    assert rows(page) == ["worn-out", "new", "waiting", "ageing", "ended"]
    columns = page.locator("table.fleet thead th").all_inner_texts()
    assert columns == [
        "Choose", "State", "Clutch", "What to do", "Safe for, cycles", "Health", "Trend", "Last run",
    ]  # fmt: skip
    heights = page.eval_on_selector_all("table.fleet tbody tr", "rows => rows.map((row) => row.offsetHeight)")
    assert all(40 <= height <= 48 for height in heights), heights
    first = page.locator("tr[data-clutch='worn-out']")
    worn = ONCE.get(f"{watched.url}/v1/clutches/worn-out").json()
    assert first.locator(".state").inner_text() == "Failure"
    assert first.locator(".do").inner_text().split("\n") == [worn["action"], worn["state"]["why"]]
    assert worn["state"]["why"] == "the end of life is reached: its limit is mean COF at 50 % of new"
    assert [row.get_attribute("data-clutch") for row in page.locator("tr.over").all()] == ["ended"]
    ageing = page.locator("tr[data-clutch='ageing']")
    said = ONCE.get(f"{watched.url}/v1/clutches/ageing").json()
    assert (said["state"]["name"], ageing.locator(".state").inner_text()) == ("normal", "Normal")
    assert f"{100 * said['summary']['current']['health']:.0f} %" in ageing.inner_text()
    safe = ageing.locator(".safe").inner_text()
    assert re.search(r"^[\d,]+\s+50 % chance of [\d,]+ or more; 90 % interval: [\d,]+ to", safe), safe
    for drawing in (".spark polyline", ".interval .median", ".health .fill"):
        assert ageing.locator(drawing).count() == 1, drawing
    assert "ago" in ageing.locator("time").inner_text() or "now" in ageing.locator("time").inner_text()
    assert "at 4,000 cycles" in ageing.locator(".last").inner_text()
    # what comes from outside is text, never markup
    assert "<i>carbon</i> on steel" in first.inner_text()
    for width in (320, 390, 1360, 2560):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    # states differ in word, shape and colour
    page.set_viewport_size({"width": 1360, "height": 900})
    found = page.eval_on_selector_all(
        "table.fleet .state svg",
        "icons => icons.map(i => [i.outerHTML, getComputedStyle(i).color, i.nextSibling.textContent])",
    )
    by_word = {word: (shape, colour) for shape, colour, word in found}
    assert set(by_word) == {"Failure", "Normal", "Function check"}
    assert len({shape for shape, _ in by_word.values()}) == len({colour for _, colour in by_word.values()}) == 3


def test_searching_and_filtering(watched: Watched) -> None:
    page = watched.open("/")
    rows(page)
    page.get_by_label("Find").fill("carbon")
    expect(page.locator("table.fleet tbody tr:visible")).to_have_count(2)
    page.get_by_role("button", name="1 failure").click()
    expect(page.locator("table.fleet tbody tr:visible")).to_have_count(1)
    page.get_by_label("Find").fill("nobody")
    page.get_by_text("No clutch matches").wait_for()
    page.get_by_label("Find").fill("")
    page.get_by_role("button", name="5 clutches").click()
    expect(page.locator("table.fleet tbody tr:visible")).to_have_count(5)


def test_by_keyboard_alone(watched: Watched) -> None:
    page = watched.open("/")
    rows(page)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "To the clutches"
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "main"
    page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    expect(page.locator("table.fleet tbody tr:visible")).to_have_count(2)
    assert page.evaluate("document.activeElement.dataset.state") == "failure"
    page.locator(".chip").last.focus()
    for focused in ("sort", "archived", "find"):
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.id") == focused
    for _ in range(10):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.tagName") == "A":
            break
    outline = page.evaluate("getComputedStyle(document.activeElement).outlineWidth")
    assert float(outline.removesuffix("px")) >= 2
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="worn-out").wait_for()


def test_a_poll_without_news_costs_a_few_hundred_bytes(watched: Watched) -> None:
    wire, statuses = Wire(watched.page), list[int]()
    watched.page.on("response", lambda answer: "/v1/clutches?" in answer.url and statuses.append(answer.status))
    page = watched.open("/")
    rows(page)
    for _ in range(60):
        if len(wire.of("/v1/clutches?")) >= 3:
            break
        page.wait_for_timeout(500)
    first, *others = wire.of("/v1/clutches?")
    print(f"\nbytes a poll: {first} with news, {others} without")
    assert first > 1000  # it is packed
    assert len(others) >= 2
    assert max(others) < 600
    assert statuses[:3] == [200, 304, 304]


def test_a_hidden_tab_asks_nothing(watched: Watched) -> None:
    page = watched.page
    page.add_init_script(
        "window.away = false; Object.defineProperty(document, 'hidden', {get: () => window.away, configurable: true});"
    )
    watched.open("/")
    rows(page)
    page.evaluate("window.away = true; document.dispatchEvent(new Event('visibilitychange'))")
    page.get_by_text("Paused, as of").wait_for()
    before = len(watched.asked)
    page.wait_for_timeout(4500)
    assert len(watched.asked) == before
    page.evaluate("window.away = false; document.dispatchEvent(new Event('visibilitychange'))")
    page.get_by_text("Live, as of").wait_for()
    assert before < len(watched.asked) <= before + 2


@pytest.mark.slow
def test_a_service_that_goes_away_and_comes_back(browser: Browser, empty: Server) -> None:
    empty.http.post("/v1/clutches", json={"clutch_id": "kept"})
    watched = Watched(browser, empty.url)
    page = watched.open("/")
    page.get_by_role("link", name="kept").wait_for()
    empty.stop()
    page.get_by_text("No answer from the service; as of").wait_for()
    assert page.get_by_role("link", name="kept").is_visible()
    waits = page.locator(".asof").inner_text()
    assert "next try in" in waits
    expect(page.locator(".asof")).to_contain_text(re.compile("next try in [56] s"))  # it asked every 3 s before
    empty.start()
    empty.http.post("/v1/clutches", json={"clutch_id": "after"})
    page.get_by_role("link", name="after").wait_for(timeout=60_000)  # it had backed off
    page.get_by_text("Live, as of").wait_for()
    assert watched.violations() == []
    watched.context.close()


def test_with_keys_the_page_asks_for_one(browser: Browser, empty: Server) -> None:
    empty.http.post("/v1/clutches", json={"clutch_id": "secret"})
    text = clutchlife("key", "create", "--scope", "read", "--database", empty.address).strip()
    watched = Watched(browser, empty.url)
    page = watched.open("/")
    page.get_by_role("heading", name="This service asks for a key").wait_for()
    assert "secret" not in page.content()
    page.get_by_role("textbox", name="Key").fill("wrong")
    page.get_by_role("button", name="Use this key").click()
    page.get_by_text("the key is unknown").wait_for()
    page.get_by_role("textbox", name="Key").fill(text)
    page.keyboard.press("Enter")
    page.get_by_role("link", name="secret").click()
    page.get_by_role("heading", name="No run has arrived").wait_for()
    assert all(text not in url for url in watched.asked)
    assert page.evaluate("localStorage.length") == 0
    watched.context.close()
